"""The documentation: nothing is left out of the site, no link is dead, and it needs nothing from elsewhere."""

import importlib.util
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import fieldkit
from fieldkit.cli.main import COMMANDS

yaml = pytest.importorskip("yaml")
ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
READ_AS_FILES = [
    *PAGES,
    ROOT / "README.md",
    *sorted((ROOT / "missions").rglob("*.md")),
    *sorted((ROOT / "sim").rglob("*.md")),
]
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
CODE = re.compile(r"(?ms)^```.*?^```|^    .*?$|`[^`\n]*`")


class _Loader(yaml.SafeLoader):
    """Reads mkdocs.yml, whose tags name Python functions, without calling anything."""


_Loader.add_multi_constructor("tag:yaml.org,2002:python/", lambda loader, suffix, node: suffix)


def settings() -> dict[str, Any]:
    loaded: dict[str, Any] = yaml.load((ROOT / "mkdocs.yml").read_text("utf-8"), _Loader)
    return loaded


def listed(nav: Any) -> Iterator[str]:
    if isinstance(nav, str):
        yield nav
    else:
        for each in nav.values() if isinstance(nav, dict) else nav:
            yield from listed(each)


def anchors(page: Path) -> set[str]:
    """The names of a page's headings, as GitHub makes them."""
    titles = re.findall(r"(?m)^#+ (.*)$", re.sub(r"(?ms)^```.*?^```", "", page.read_text("utf-8")))
    names = (re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", title).lower() for title in titles)
    return {re.sub(r"[^\w\- ]", "", name).strip().replace(" ", "-") for name in names}


def test_every_page_is_in_the_navigation_once() -> None:
    pages = list(listed(settings()["nav"]))
    assert len(pages) == len(set(pages))
    mine = {page.relative_to(DOCS).as_posix() for page in PAGES}
    assert mine <= set(pages), f"not in mkdocs.yml: {mine - set(pages)}"
    spec = importlib.util.spec_from_file_location("site_hooks", ROOT / "scripts" / "site_hooks.py")
    assert spec is not None
    outside = set(re.findall(r'"(files/[a-z]+\.md)"', (ROOT / "scripts" / "site_hooks.py").read_text("utf-8")))
    examples = {f"examples/{path.stem}.md" for path in (DOCS / "examples").glob("*.py")}
    assert outside | examples <= set(pages)
    assert set(pages) == mine | outside | examples


@pytest.mark.parametrize("page", READ_AS_FILES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page: Path) -> None:
    """As files, as GitHub shows them; what the site makes of them the build checks."""
    for target in LINK.findall(CODE.sub("", page.read_text("utf-8"))):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        file = page if not name else (page.parent / name).resolve()
        assert file.exists(), f"{page.name}: {target}"
        # The anchors of the Python reference are made from the code.
        if anchor and file.suffix == ".md" and file.parent.name != "api":
            assert anchor in anchors(file), f"{page.name}: {target}"


def test_every_command_schema_and_export_has_its_place() -> None:
    index = (DOCS / "index.md").read_text("utf-8")
    for name in COMMANDS:
        assert f"(commands/{name.split()[0]}.md)" in index
    schemas = (DOCS / "schemas" / "README.md").read_text("utf-8")
    for path in (DOCS / "schemas").glob("*.json"):
        assert f"({path.name})" in schemas
    reference = "".join(path.read_text("utf-8") for path in (DOCS / "api").glob("*.md"))
    for name in set(fieldkit.__all__) - {"__version__", "FieldkitError"}:
        assert f"::: fieldkit.{name}\n" in reference


@pytest.mark.slow
def test_builds_without_a_warning_and_loads_nothing_from_elsewhere(tmp_path: Path) -> None:
    pytest.importorskip("mkdocs", reason="the extra docs is not installed")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    pages = list(tmp_path.rglob("*.html"))
    assert len(pages) >= len(PAGES)
    loaded = re.compile(
        r"""<(?:script|img|iframe|source)[^>]*\bsrc=["']?(?:https?:)?//|<link[^>]*rel=["']?(?:stylesheet|preload|preconnect)"""
        r"""["']?[^>]*href=["']?(?:https?:)?//|@import\s+url\(["']?https?:|url\(["']?https?:"""
    )
    for path in [*pages, *tmp_path.rglob("*.css")]:
        assert not loaded.search(path.read_text("utf-8")), path
    verbs = (tmp_path / "api" / "verbs.html").read_text("utf-8")
    for name in ("build_reference", "plan", "check", "evaluate", "export_mission", "write_report"):
        assert f'id="fieldkit.{name}"' in verbs
    assert "find the cameras" in verbs.lower()
    found = (tmp_path / "search" / "search_index.json").read_text("utf-8")
    assert "evaluate_captures" in found
