"""What the validators of SkyPilot, Open Job Description and botocore say of deploy/cloud. No effects.

Run by a Python that has them (pip install skypilot openjd-cli botocore), which this project's need not be:
`python cloud_validators.py DEPLOY_CLOUD` prints a JSON object, file -> what is wrong with it, "" for nothing.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final


def _of_batch(file: Path) -> str:
    """botocore's shapes of AWS Batch; a file is named as the operation that takes it."""
    import botocore.session
    from botocore import xform_name
    from botocore.validate import ParamValidator

    model: Any = botocore.session.get_session().get_service_model("batch")
    names = {xform_name(name, "-"): name for name in model.operation_names}
    shape = model.operation_model(names[file.stem]).input_shape
    return str(
        ParamValidator().validate(json.loads(file.read_text("utf-8")), shape).generate_report()
    )


def _of_openjd(file: Path) -> str:
    words = [str(Path(sys.executable).parent / "openjd"), "check", str(file)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    return "" if done.returncode == 0 else done.stdout + done.stderr


def _of_skypilot(file: Path) -> str:
    import sky

    try:
        sky.Task.from_yaml(str(file))
    except Exception as error:  # noqa: BLE001 - whatever it does not like is the answer
        return str(error) or type(error).__name__
    return ""


VALIDATORS: Final[dict[str, Callable[[Path], str]]] = {
    "batch/*.json": _of_batch, "openjd.yaml": _of_openjd, "skypilot.yaml": _of_skypilot,
}  # fmt: skip
"""Files below deploy/cloud -> what says what is wrong with one."""


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    said = {
        str(f.relative_to(folder)): say(f)
        for files, say in VALIDATORS.items()
        for f in folder.glob(files)
    }
    print(json.dumps(said))
