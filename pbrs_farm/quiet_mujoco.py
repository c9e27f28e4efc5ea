"""MuJoCo, without the MUJOCO_LOG.TXT that it writes its warnings into, wherever a program runs.

Effects: warnings of MuJoCo are dropped from here on; its errors are raised as ever.

    from pbrs_farm.quiet_mujoco import mujoco
"""

from __future__ import annotations

import mujoco

mujoco.set_mju_user_warning(lambda _text: None)

__all__ = ["mujoco"]
