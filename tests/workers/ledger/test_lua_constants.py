"""Constants shared by Lua and Python are defined once, in Python."""

import re
from pathlib import Path

import pytest

import workers.ledger.redis_ledger as ledger
from workers.ids import STAGES
from workers.ledger.task_ledger import ALIVE_S, STATES

SCRIPTS = sorted(Path(ledger.__file__).with_name("lua").glob("*.lua"))
# Words that are a stage and something else: a key in Redis, an order that `steer` takes.
OTHER_WORDS = {"job"}, {"steer": {"reduce"}}


def test_lua_gets_the_states_the_stages_and_the_age_of_live_workers() -> None:
    constants = ledger.lua_constants()
    assert f"local ALIVE_S = {ALIVE_S:g}\n" in constants
    assert all(f"local {name} = '{letter}'\n" in constants for name, letter in STATES.items())
    assert all(f"local {stage.upper()}_STAGE = '{stage}'\n" in constants for stage in STAGES)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_no_script_defines_a_stage_a_state_or_a_workers_age(script: Path) -> None:
    code = re.sub(r"--.*", "", script.read_text())
    words = set(re.findall(r"'([^']*)'", code))
    keys, orders = OTHER_WORDS
    assert not words & (set(STAGES) - keys - orders.get(script.stem, set()))
    assert not words & set(STATES.values())
    assert not re.search(rf"\b{ALIVE_S:g}\b", code)
