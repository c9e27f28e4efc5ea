"""A killed and resumed render makes the picture of an uninterrupted one."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import pytest

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.recipe import LightFields
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport.light_result import LightResult
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.render_checkpoint import Arrays
from pbrs_farm.transport.scene_tables.sky import sunsky, uniform_sky
from pbrs_farm.transport.validation import known_rooms as rooms
from tests.inputs.rendered_rooms import FIELDS, RECIPE

pytestmark = pytest.mark.skipif(
    choose_variant().startswith("scalar"), reason="the kernels need LLVM or CUDA"
)

METROPOLIS_VIEW = "pbrs_farm.transport.metropolis.metropolis_view"
PIXELS = 32 * 24
METROPOLIS: LightFields = FIELDS.model_copy(
    update={
        "integrator": "metropolis",
        "direct_spp": 8,
        "mutations_per_pixel": 64,
        "chains": 512,
        "tail_pixels": 64,
    }
)


class Killed(Exception):
    """Simulates the end of the process."""


class Memory:
    """Stores every state; raises Killed after n of them."""

    spent_s = 0.0

    def __init__(self, n: int = 1 << 30, loaded: dict[str, Arrays] | None = None) -> None:
        self.states: dict[str, Arrays] = {}
        self.shares: list[float] = []
        self._n = n
        self._loaded = loaded or {}

    def kept(self, part: str) -> Arrays:
        return self._loaded.get(part, {})

    def keep(self, part: str, share: float, state: Callable[[], Arrays]) -> None:
        self.shares.append(share)
        self.states[part] = {name: np.array(array) for name, array in state().items()}
        if len(self.shares) == self._n:
            raise Killed


@lru_cache(maxsize=2)
def scene_and_camera(*, is_sunny: bool) -> tuple[LightScene, Camera]:
    house, camera = rooms.window_room(lumen=800)
    # The sun is in front of the window, so that each launch has different sunlit points.
    sun = sunsky(RECIPE, elevation_rad=0.5, azimuth_rad=0.35)
    scene = LightScene.load(house, {}, RECIPE, sun if is_sunny else uniform_sky((1, 1, 1)))
    return scene, camera.with_size(32, 24)


def rendered(fields: LightFields, checkpoint: Memory, *, is_sunny: bool = False) -> LightResult:
    scene, camera = scene_and_camera(is_sunny=is_sunny)
    return scene.render(camera, "0_0", fields, 7, checkpoint)


def resumed(fields: LightFields, n: int, *, is_sunny: bool = False) -> LightResult:
    """The picture of a render killed after storing n states and resumed."""
    killed = Memory(n)
    with pytest.raises(Killed):
        rendered(fields, killed, is_sunny=is_sunny)
    return rendered(fields, Memory(loaded=killed.states), is_sunny=is_sunny)


@pytest.fixture
def _short_launches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pbrs_farm.transport.sample_passes.SAMPLES_PER_LAUNCH", 4 * PIXELS)
    one_round = METROPOLIS.chains
    monkeypatch.setattr(f"{METROPOLIS_VIEW}.chain_rounds_per_launch", lambda: one_round)


@pytest.mark.quick(2)
@pytest.mark.usefixtures("_short_launches")
@pytest.mark.parametrize(
    "changes",
    [{"spp": 14}, {"spp": 4, "noise": 0.12, "max_spp": 256}, {"spp": 8, "groups": "lamps"}],
)
@pytest.mark.parametrize("is_sunny", [False, True])
def test_a_resumed_path_render_has_the_same_bits(
    changes: dict[str, object], is_sunny: bool
) -> None:
    fields = FIELDS.model_copy(update=changes)
    whole = rendered(fields, Memory(), is_sunny=is_sunny)
    again = resumed(fields, 1, is_sunny=is_sunny)
    assert again.spp == whole.spp > 4
    assert again.noise == whole.noise
    for name in ("outdoor", "indoor", "albedo", "normal"):
        np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))
    assert list(again.lamps) == list(whole.lamps)


@pytest.mark.quick(1)
@pytest.mark.usefixtures("_short_launches")
@pytest.mark.parametrize("n", [1, 3, 5])  # in direct light, among the chains' first prefixes, later
def test_a_resumed_metropolis_render_has_the_same_picture(n: int) -> None:
    whole, again = rendered(METROPOLIS, Memory()), resumed(METROPOLIS, n)
    assert again.facts["indoor"]["mutations"] == whole.facts["indoor"]["mutations"]
    for name in ("outdoor", "indoor"):
        a, b = getattr(again, name), getattr(whole, name)
        assert b.mean() > 0
        np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-5 * float(b.mean()))


@pytest.mark.usefixtures("_short_launches")
def test_the_finished_share_grows_to_one() -> None:
    memory = Memory()
    rendered(METROPOLIS, memory)
    assert memory.shares == sorted(memory.shares)
    assert memory.shares[-1] == 1.0
    assert len(memory.shares) > 2


@pytest.mark.long
def test_metropolis_leaves_out_mutations_once_the_noise_is_reached() -> None:
    long = METROPOLIS.model_copy(update={"mutations_per_pixel": 1024, "noise": 0.1})
    result = rendered(long, Memory())
    n_made = result.facts["indoor"]["mutations"]
    assert result.noise["sum"] <= 0.1
    assert 0 < n_made < 1024 * PIXELS / 2
    assert n_made == result.facts["outdoor"]["mutations"]
