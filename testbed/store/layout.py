"""Names of the files in the folders that are written, and what marks them."""

from testbed.disk import LOCK as LOCK
from testbed.disk import TEMPORARY as TEMPORARY

FORMAT = 1
"""Version of the run folder's format this program writes; it reads this one."""
SCENARIO, MANIFEST, TRIALS = "scenario.toml", "manifest.json", "trials"
RESULT, ARRAYS, REPORT, RECORDING = "result.json", "arrays.npz", "report.html", "campaign.rrd"
DERIVED = (RESULT, ARRAYS, REPORT, RECORDING)
"""Derived files, in the order in which they are written."""
RECORDING_ENDING = ".rrd"
OF_TRIAL = ("campaign-", RECORDING_ENDING)
"""What stands about the name of a trial in the name of its recording; RECORDING shows the first."""
PARTS = "parts"
"""Pieces of the records that are played in pieces; they stay, so that more robots reuse them."""
TIMING, LOG, UNFINISHED = "timing.json", "log.jsonl", "UNFINISHED.txt"
CRASH = "crash.txt"
"""Traceback of a defect of ours."""
PLAN, ISO9283 = "plan.json", "iso9283.csv"
PLAYED_PLAN, PLAYED_TEST, TEST = "plan.rrd", "iso9283.rrd", "test.npz"
"""Their recordings, and the record from which that of a test is written again."""
OWNERS = {
    PLAN: "a plan's folder",
    ISO9283: "the folder of a test after ISO 9283",
    MANIFEST: "a run folder",
    "session.toml": "an exported session's folder",
}
"""What the file that marks a folder, written last, makes it; no other folder is renamed."""
OURS = (SCENARIO, MANIFEST, *DERIVED, TIMING, LOG, UNFINISHED, LOCK, CRASH)
"""Every file a run may leave in its folder, beside trials/."""
