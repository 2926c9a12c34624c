"""Hold `[tool.budget]` in pyproject.toml: lines of Python per package, words per folder of documentation.

python scripts/budget.py            fail where a figure is exceeded, naming the files that grew
python scripts/budget.py --table    print what every entry has and may have
python scripts/budget.py --lower    lower every figure to what is there; nothing is ever raised
"""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SETTINGS = ROOT / "pyproject.toml"
_UNITS = {".py": "lines", ".md": "words"}


def entries() -> dict[str, int]:
    """The budget: a folder or file, and what it may have."""
    budget: dict[str, int] = tomllib.loads(SETTINGS.read_text("utf-8"))["tool"]["budget"]
    return budget


def tracked() -> list[str]:
    """The files git keeps or would keep; outside a checkout every file."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True
    )
    names = listed.stdout.splitlines() if listed.returncode == 0 else []
    return names or [str(path.relative_to(ROOT)) for path in ROOT.rglob("*") if ".venv" not in path.parts]


def size(path: Path) -> int:
    """Lines of a Python file, words of a page."""
    text = path.read_text("utf-8")
    return len(text.splitlines()) if path.suffix == ".py" else len(text.split())


def home(name: str, budget: dict[str, int]) -> str | None:
    """The entry that counts a file: the longest that it lies in."""
    if Path(name).suffix not in _UNITS or not (ROOT / name).is_file():
        return None
    return max((entry for entry in budget if name == entry or name.startswith(f"{entry}/")), key=len, default=None)


def counted(budget: dict[str, int]) -> dict[str, dict[str, int]]:
    """Per entry the sizes of its files. A folder counts the kind it has: Python in code, Markdown in docs."""
    found: dict[str, dict[str, int]] = {entry: {} for entry in budget}
    for name in sorted(set(tracked())):
        entry = home(name, budget)
        if entry is not None and (Path(name).suffix == ".md") == (entry.startswith("docs") or entry.endswith(".md")):
            found[entry][name] = size(ROOT / name)
    return found


def grown(files: dict[str, int]) -> list[str]:
    """The files of an entry that grew since the budget was last changed, most first."""
    last = subprocess.run(
        ["git", "log", "-1", "--format=%H", "-G", r"^\"?[a-z/]+\"? = \d+$", "--", "pyproject.toml"],
        cwd=ROOT, capture_output=True, text=True,
    ).stdout.strip()  # fmt: skip
    rows = []
    for name, now in files.items():
        old = subprocess.run(["git", "show", f"{last}:{name}"], cwd=ROOT, capture_output=True, text=True)
        before = 0 if old.returncode else len(old.stdout.splitlines() if name.endswith(".py") else old.stdout.split())
        if now > before:
            rows.append((now - before, name))
    return [f"{name} +{more}" for more, name in sorted(rows, reverse=True)[:8]]


def main() -> int:
    """Check, print or lower the budget."""
    budget = entries()
    sizes = counted(budget)
    totals = {entry: sum(files.values()) for entry, files in sizes.items()}
    if "--lower" in sys.argv:
        text = SETTINGS.read_text("utf-8")
        for entry, total in totals.items():
            text = re.sub(rf'(?m)^"{re.escape(entry)}" = \d+$', f'"{entry}" = {min(total, budget[entry])}', text)
        SETTINGS.write_text(text, "utf-8")
        return 0
    if "--table" in sys.argv:
        for entry, total in totals.items():
            print(f"{entry:40} {total:7} of {budget[entry]:7}")
        for top in ("fieldkit", "sim", "benchmarks", "tests", "docs"):
            print(f"{top:40} {sum(total for entry, total in totals.items() if entry.split('/')[0] == top):7} in all")
        return 0
    over = [entry for entry, total in totals.items() if total > budget[entry]]
    for entry in over:
        unit = "words" if entry.startswith("docs") or entry.endswith(".md") else "lines"
        print(f"{entry}: {totals[entry]} {unit}, {totals[entry] - budget[entry]} over its budget of {budget[entry]}")
        for row in grown(sizes[entry]):
            print(f"    {row}")
    if over:
        print(
            "Take lines out, or lower another entry of [tool.budget] in pyproject.toml by as much in the same commit."
        )
    return 1 if over else 0


if __name__ == "__main__":
    sys.exit(main())
