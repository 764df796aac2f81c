"""The command `truebed` with the fake campaign: run in its own process by tests of faults."""

import os
import signal

from testbed.__main__ import main
from testbed.run import play as runner
from tests.testbed.studies.trial.fake_campaign import Fake

if __name__ == "__main__":
    # a child of a script's background job is born with this signal ignored
    signal.signal(signal.SIGINT, signal.default_int_handler)
    pause = float(os.environ.get("FAKE_PAUSE", "0"))
    failing = tuple(filter(None, os.environ.get("FAKE_FAILING", "").split(",")))
    fake = Fake(pause, failing)
    runner.all_studies = lambda _: (fake,)
    runner.derived_file = fake.derive
    main()
