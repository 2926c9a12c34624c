"""What commands print for people: tables with all their rows, and lines that are neither markup nor broken."""

import pytest

from fieldkit.cli.common import show, table


def test_tables_texts_and_lines(capsys: pytest.CaptureFixture[str]) -> None:
    path = "/data/[bold]" + "x" * 200
    show(
        [*table("Plots of [red]", ["plot", "size>"], [(f"[b]{k} of the field", str(k)) for k in range(50)]), "[i]text"],
        path,
    )
    printed = capsys.readouterr()
    assert printed.err == ""
    lines = [line.strip() for line in printed.out.splitlines()]
    assert lines[0] == "Plots of [red]"
    assert [line.split()[0] for line in lines if line.startswith("[b]")] == [f"[b]{k}" for k in range(50)]
    assert lines[-2:] == ["[i]text", path]
