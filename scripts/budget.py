"""Hold `[tool.budget]` in pyproject.toml: totals of Python tokens per top folder, and of words of documentation.

python scripts/budget.py            fail where a total is exceeded; name the files that grew most
python scripts/budget.py --table    print the totals, and what grew and fell by package
python scripts/budget.py --lower    lower every total to what is there; nothing is ever raised
"""

from __future__ import annotations

import ast
import io
import re
import subprocess
import sys
import tokenize
import tomllib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SETTINGS = ROOT / "pyproject.toml"
_CODE = frozenset({tokenize.NAME, tokenize.OP, tokenize.NUMBER, tokenize.STRING})
# From Python 3.12 on an f-string comes in pieces, which may nest. Before, and so here, it is one token.
_F_STRING_BEGINS = getattr(tokenize, "FSTRING_START", -1)
_F_STRING_ENDS = getattr(tokenize, "FSTRING_END", -1)
# Number of files and packages named where a total grew.
_NAMED = 10


def docstring_lines(text: str) -> frozenset[int]:
    """The lines on which a text that stands alone as a statement begins: docstrings and constants' texts."""
    return frozenset(
        node.lineno
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
    )


def tokens(text: str) -> int:
    """Names, operators, numbers and strings of a Python source, without comments and docstrings."""
    documentation = docstring_lines(text)
    count = nesting = 0
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        begins = token.type == _F_STRING_BEGINS
        if not nesting and (begins or token.type in _CODE):
            count += not (token.type == tokenize.STRING and token.start[0] in documentation)
        nesting += begins - (token.type == _F_STRING_ENDS)
    return count


def size(name: str, text: str) -> int:
    """Tokens of a Python file, words of a page."""
    return len(text.split()) if name.endswith(".md") else tokens(text)


def total_of(name: str, budget: dict[str, int]) -> str | None:
    """The total that counts a file: Python in code, Markdown in docs and of a page named by itself."""
    if name in budget:
        return name
    top = name.partition("/")[0]
    return top if top in budget and name.endswith(".md" if top == "docs" else ".py") else None


def git(*arguments: str) -> str:
    """What git prints; nothing outside a checkout."""
    return subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True).stdout


def files(budget: dict[str, int]) -> Iterator[tuple[str, str]]:
    """The counted files that git keeps or would keep, outside a checkout all, each with its total."""
    names = git("ls-files", "--cached", "--others", "--exclude-standard").splitlines() or [
        str(path.relative_to(ROOT)) for top in budget for path in (ROOT / top).rglob("*")
    ]
    for name in sorted({*names}):
        total = total_of(name, budget)
        if total is not None and (ROOT / name).is_file():
            yield name, total


def growth(budget: dict[str, int]) -> Counter[str]:
    """By how much files that changed since totals were last set grew (or fell, below 0)."""
    since = git("log", "-1", "--format=%H", "-G", r"^\"?[a-zA-Z/.]+\"? = [0-9]+$", "--", "pyproject.toml").strip()
    grew: Counter[str] = Counter()
    for name in git("diff", "--name-only", "--no-renames", since).splitlines():
        if total_of(name, budget) is not None:
            path = ROOT / name
            now = size(name, path.read_text("utf-8")) if path.is_file() else 0
            grew[name] = now - size(name, git("show", f"{since}:{name}"))
    return grew


def main() -> int:
    """Check, print or lower the totals."""
    budget: dict[str, int] = tomllib.loads(SETTINGS.read_text("utf-8"))["tool"]["budget"]
    sizes: Counter[str] = Counter()
    for name, total in files(budget):
        sizes[total] += size(name, (ROOT / name).read_text("utf-8"))
    if "--lower" in sys.argv:
        text = SETTINGS.read_text("utf-8")
        for total, allowed in budget.items():
            text = re.sub(rf'(?m)^"{re.escape(total)}" = {allowed}$', f'"{total}" = {min(sizes[total], allowed)}', text)
        SETTINGS.write_text(text, "utf-8")
        return 0
    over = [total for total, allowed in budget.items() if sizes[total] > allowed]
    if over or "--table" in sys.argv:
        for total, allowed in budget.items():
            print(f"{total:40} {sizes[total]:8} of {allowed:8}" + "  exceeded" * (total in over))
        grew = growth(budget)
        packages: Counter[str] = Counter()
        for name, more in grew.items():
            packages["/".join(name.split("/")[:2])] += more
        print("Since the totals were last set:")
        for rows in (packages, grew):
            for name, more in rows.most_common(_NAMED):
                print(f"    {name} {more:+}")
    if over:
        print("Take as much away in the same commit. No total of [tool.budget] in pyproject.toml is raised.")
    return 1 if over else 0


if __name__ == "__main__":
    sys.exit(main())
