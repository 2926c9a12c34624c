"""Name numeric constants of modules that share a line or have no text (meaning, unit and reason).

python scripts/constants.py FOLDER…        fail where there are some
"""

from __future__ import annotations

import ast
import sys
from pathlib import Path


def numeric(value: ast.expr | None) -> bool:
    """Whether an expression is made of numbers alone."""
    return isinstance(value, ast.expr) and all(
        isinstance(node, ast.BinOp | ast.UnaryOp | ast.operator | ast.unaryop | ast.Tuple | ast.expr_context)
        or (isinstance(node, ast.Constant) and type(node.value) in {int, float})
        for node in ast.walk(value)
    )


def unexplained(text: str) -> list[tuple[int, str]]:
    """Line and name of numeric constants without a text of their own: a string below, or a comment above or beside."""
    lines, body = text.splitlines(), ast.parse(text).body
    texts = {node.lineno for node in body if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)}
    names = []
    for node in body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or not numeric(node.value):
            continue
        target = node.targets[0] if isinstance(node, ast.Assign) else node.target
        above, beside = lines[node.lineno - 2].strip(), lines[(node.end_lineno or 0) - 1]
        said = (node.end_lineno or 0) + 1 in texts or above.startswith("#") or "  # " in beside
        if isinstance(target, ast.Tuple) or not said:
            names.append((node.lineno, ast.unparse(target)))
    return names


def main() -> int:
    """Print every constant that lacks a text; 1 if there are some."""
    wrong = [
        f"{path}:{line}: {name}"
        for top in sys.argv[1:]
        for path in sorted(Path(top).rglob("*.py"))
        for line, name in unexplained(path.read_text("utf-8"))
    ]
    print(*wrong, sep="\n", end="\n" * bool(wrong))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
