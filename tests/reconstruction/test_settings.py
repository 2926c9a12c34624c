"""What a choice of mapping stands for."""

import pytest

from fieldkit.reconstruction.settings import mapping_methods


@pytest.mark.parametrize(
    ("positioned", "photographs", "methods"),
    [
        (10, 10, ("prior",)),
        (8, 10, ("prior",)),
        (7, 10, ("incremental", "global")),
        (3, 3, ("prior",)),
        (2, 2, ("incremental", "global")),
        (0, 10, ("incremental", "global")),
    ],
)
def test_auto_is_prior_with_known_positions_else_incremental_else_global(positioned, photographs, methods) -> None:
    assert mapping_methods("auto", positioned, photographs) == methods
