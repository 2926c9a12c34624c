"""What the documentation's site has beside docs/: READMEs of the data folders, and a page for every example.

MkDocs calls these functions (mkdocs.yml, `hooks`). Links in the sources are those of the repository, so that they work
where it is read as files; here they are turned to the site's.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = "docs/examples"
# Files of the repository outside docs/, and where they are in the site.
OUTSIDE = {
    "missions/README.md": "files/missions.md",
    "sim/README.md": "files/scenes.md",
    "sim/sitl/README.md": "files/recordings.md",
    **{
        path.relative_to(ROOT).as_posix(): f"files/{path.parent.name}/{path.name}"
        for folder in ("sites", "vehicles")
        for path in sorted((ROOT / "missions" / folder).iterdir())
    },
}
_LINK = re.compile(r"(\]\()([^)\s#:]+)(#[^)\s]*)?(\))")


def on_files(files: Files, *, config: Any) -> Files:
    """Add the files outside docs/ and the pages of the examples."""
    for name, uri in OUTSIDE.items():
        files.append(File.generated(config, uri, abs_src_path=str(ROOT / name)))
    for path in sorted((ROOT / EXAMPLES).glob("*.py")):
        page = example_page(path.read_text("utf-8"), path.name)
        files.append(File.generated(config, f"examples/{path.stem}.md", content=page))
    return files


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """Turn the repository's links into the site's; a link to an example's script leads to its page."""
    uri = page.file.src_uri
    source = next((name for name, site in OUTSIDE.items() if site == uri), f"docs/{uri}")

    def turned(link: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(posixpath.dirname(source), link[2]))
        if target in OUTSIDE:
            site = OUTSIDE[target]
        elif target.startswith("docs/"):
            site = target.removeprefix("docs/")
            script = target.startswith(EXAMPLES) and site.endswith(".py")
            if script and site != uri.replace(".md", ".py"):
                site = site.replace(".py", ".md")
        else:
            return link[0]  # MkDocs says that there is no such page
        return f"{link[1]}{posixpath.relpath(site, posixpath.dirname(uri) or '.')}{link[3] or ''}{link[4]}"

    return _LINK.sub(turned, markdown)


def example_page(source: str, name: str) -> str:
    """A script in percent format as Markdown: its docstring and text cells as text, code as code."""
    text = ""
    for cell in re.split(r"(?m)^# %%", source):
        kind, _, body = cell.partition("\n")
        if kind.strip() == "[markdown]":
            text += "".join(re.sub(r"^# ?", "", line) for line in body.strip().splitlines(keepends=True)) + "\n\n"
        elif not text:
            title, _, rest = re.sub(r'"""', "", cell).strip().partition("\n")
            text = f"# {title.rstrip('.')}\n\n{rest.strip()}\n\n[{name}]({name})\n\n"
        elif body.strip():
            text += f"```python\n{body.strip()}\n```\n\n"
    return text
