"""MuJoCo without MUJOCO_LOG.TXT, the file of warnings that it creates in the working directory.

Effects: MuJoCo's warnings are dropped from now on; its errors are still raised.

    from pbrs_farm.quiet_mujoco import mujoco
"""

from __future__ import annotations

import mujoco

mujoco.set_mju_user_warning(lambda _text: None)

__all__ = ["mujoco"]
