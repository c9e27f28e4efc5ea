import pytest

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import SplitShares, home_of, shares_from_text, split_of_house


@pytest.mark.parametrize(
    ("house", "home"),
    [
        ("studio-1a2b3c4d", "studio"),
        ("studio-1a2b3c4d-d3", "studio"),
        ("made-17-00112233-d12", "made-17"),
        ("object_chair-00aa11bb", "object_chair"),
        ("studio", "studio"),
        ("4500db61", "4500db61"),
    ],
)
def test_a_home_is_its_id_without_digest_and_variant(house: str, home: str) -> None:
    assert home_of(house) == home


def test_variants_and_redrawn_homes_stay_together() -> None:
    for home in (f"home-{k}" for k in range(50)):
        ids = [f"{home}-00000000", f"{home}-ffffffff", f"{home}-12345678-d9"]
        assert len({split_of_house(house) for house in ids}) == 1


def test_splits_have_the_requested_size() -> None:
    splits = [split_of_house(f"made-{k}-00000000") for k in range(4000)]
    assert splits.count("train") / 4000 == pytest.approx(0.8, abs=0.02)
    assert splits.count("val") / 4000 == pytest.approx(0.1, abs=0.015)


def test_a_larger_share_moves_homes_in_one_direction() -> None:
    small, large = SplitShares(0.5, 0.25, 0.25), SplitShares(0.7, 0.15, 0.15)
    for k in range(500):
        if split_of_house(f"made-{k}", small) == "train":
            assert split_of_house(f"made-{k}", large) == "train"


def test_the_split_of_a_home_never_changes() -> None:
    # Recorded: a change would put test homes into training.
    splits = {"studio": "val", "made-1": "train", "made-3": "train", "builtin": "train"}
    assert {home: split_of_house(home) for home in splits} == splits


@pytest.mark.parametrize("text", ["80/20", "a/b/c", "0/0/0", "-1/1/1", "80/10/10/0", ""])
def test_wrong_shares_are_refused(text: str) -> None:
    with pytest.raises(BadInput):
        shares_from_text(text)
