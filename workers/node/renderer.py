"""Task handler of a render process of the farm: runs the configured runner.

Effects: the runner's. A request is a workers.runner.TaskRequest as JSON; the last message's body is a
Result, or the class and fingerprint of the fault.
"""

from __future__ import annotations

import traceback

from pbrs_farm.run.processes.messages import Handler, Message, Send
from workers.config import config_from_environment
from workers.node.faults import class_of, fingerprint, one_line
from workers.runner import StepRunner, TaskRequest, runner_maker

HANDLER = f"{__name__}:make_handler"


def make_handler(send: Send) -> Handler:
    """The handler, in the render process, of the configured runner: takes a TaskRequest as JSON."""

    # The supervisor of this process stops its clocks, the slot opens the breaker.
    def on_waiting(reason: str) -> None:
        send(Message("waiting", reason))

    config = config_from_environment()
    runner = runner_maker(config.runner)(config, on_waiting)
    return lambda line: _run_task(runner, TaskRequest.model_validate_json(line), send)


def _run_task(runner: StepRunner, request: TaskRequest, send: Send) -> Message:
    try:
        result = runner.run(request, lambda step: send(Message("step", step)))
    except (Exception, SystemExit) as error:  # noqa: BLE001 - reported, by class
        traceback.print_exc()
        body = {"fault": class_of(error), "fingerprint": fingerprint(error)}
        return Message("fault", one_line(error), body)
    return Message("done", body=result.model_dump())
