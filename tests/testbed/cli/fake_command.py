"""The command `truebed` with the fake campaign: run in its own process by tests of faults."""

import os
import signal
import sys

from testbed.__main__ import main
from testbed.run import play as runner
from tests.testbed.studies.trial.fake_campaign import Fake


def run_command(words: object, fake: Fake) -> None:
    """Give the command these words, in a process that ends with it."""
    # a child of a script's background job is born with this signal ignored
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.argv = ["truebed", *map(str, words)]
    runner.all_studies = lambda _: (fake,)
    runner.derived_file = fake.derive
    main()


if __name__ == "__main__":
    pause = float(os.environ.get("FAKE_PAUSE", "0"))
    failing = tuple(filter(None, os.environ.get("FAKE_FAILING", "").split(",")))
    run_command(sys.argv[1:], Fake(pause, failing))
