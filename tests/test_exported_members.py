"""What `import fieldkit` offers."""

import inspect
import subprocess
import sys

import pytest

import fieldkit

HEAVY = ("numpy", "pydantic", "pycolmap", "cv2", "matplotlib", "rich", "typer", "scipy", "numba")


def test_all_is_complete_and_sorted() -> None:
    assert fieldkit.__all__ == sorted(fieldkit.__all__)
    assert set(fieldkit.__all__) <= set(dir(fieldkit))


@pytest.mark.parametrize("name", sorted({*fieldkit._homes()} - {"__version__"}))
def test_member_is_there_and_documented(name: str) -> None:
    member = getattr(fieldkit, name)
    assert inspect.unwrap(member).__module__ == fieldkit._homes()[name]
    assert inspect.getdoc(member)


def test_unknown_member() -> None:
    with pytest.raises(AttributeError, match="'fieldkit' has no attribute 'build_castle'"):
        _ = fieldkit.build_castle


def test_import_is_light() -> None:
    script = f"import sys, fieldkit; print([name for name in {HEAVY!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
