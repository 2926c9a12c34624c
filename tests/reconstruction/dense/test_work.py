"""What the passes of dense stereo are said to cost, from which the time left is told."""

from fieldkit.reconstruction.dense.depth_maps import _work_of_passes


def test_coarse_passes_are_most_of_the_number_and_less_than_half_of_the_work() -> None:
    """Measured on ten views of basil at standard fidelity, CPU seconds: 4.9, 2.2, 2.1, 12.9, 10.2."""
    work = _work_of_passes(1)
    assert len(work) == 5
    assert 0.2 < sum(work[:3]) / sum(work) < 0.4


def test_without_coarser_levels() -> None:
    assert _work_of_passes(0) == [3.0, 1.5]
