"""Hatch's build hook: packages hold the reports' 3D view, which is made and not kept in the repository."""

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

NEEDED = ("viewer.min.js", "LICENSE.three.txt")


class ViewerHook(BuildHookInterface):
    """Refuses to pack without the 3D view. An editable installation may go without: its `make setup` makes it."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version == "editable":
            return
        folder = Path(self.root) / "fieldkit" / "report" / "html" / "vendor"
        missing = [name for name in NEEDED if not (folder / name).is_file()]
        if missing:
            raise SystemExit(
                f"fieldkit: {folder / missing[0]} is missing, without which reports have no 3D view. Run "
                "scripts/build_viewer.sh first (it needs npm), then build again."
            )
