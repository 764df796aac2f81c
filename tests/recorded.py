"""A small campaign to record, played once per process, and how to read a recording back."""

import re
from functools import cache

import numpy as np

from testbed.recording.story import timeline_of
from testbed.robots.catalog import load_robot
from testbed.run.derive import campaign_story, chapters_of, recording_bytes
from testbed.scenario.read import changed
from testbed.studies import load_scenario
from testbed.studies.trial.recording_cell import show
from tests import campaign

SMALL = {
    "pool.size": 60,
    "test.poses": 12,
    "uncertainty.repeats": 2,
    "uncertainty.replications": 3,
    "studies.random_sets": 5,
}


@cache
def small_campaign():
    """The scene quick with joints that wobble and do not sag, fewer poses and fewer repeats."""
    scenario = changed(
        load_scenario("quick"),
        {
            **SMALL,
            "truth.preset": "wen2022",
            "truth.gravity_mdeg": [0.0, 0.0, 0.0],
            "truth.harmonic_mdeg": 4.0,
        },
    )
    return campaign.played(scenario)


@cache
def bytes_of(played):
    """The recording of a campaign."""
    return recording_bytes(played, load_robot(played.scenario.robot))


def record(path, played=None):
    """Write the recording of a campaign, made once per process; returns its path."""
    path.write_bytes(bytes_of(played or small_campaign()))
    return path


def told(campaign):
    """What a campaign's recording tells."""
    return campaign_story(campaign, load_robot(campaign.scenario.robot))


def shown(campaign):
    """The trial that a campaign's recording shows."""
    return show(campaign, campaign.trials[0])


def timeline(campaign):
    """Where the phases of a campaign's recording lie."""
    return timeline_of(chapters_of(campaign))


def store(path):
    """An opened recording."""
    from rerun.chunk import RrdReader

    return RrdReader(str(path)).store()


def column(opened, entity, component, timeline="step"):
    """Sequence (r,) and cells (r lists) of a component's rows, in the order of the timeline."""
    at, cells = [], []
    for chunk in opened.stream().filter(content=entity):
        batch = chunk.to_record_batch()
        if {timeline, component} <= set(batch.schema.names):
            at += np.asarray(batch[timeline]).astype(np.int64).tolist()
            cells += batch[component].to_pylist()
    order = np.argsort(at, kind="stable")
    return np.array(at)[order], [cells[k] for k in order]


def scalars(opened, entity, timeline="step"):
    """Sequence (r,) and values (r,) of a curve."""
    at, cells = column(opened, entity, "Scalars:scalars", timeline)
    return at, np.array([cell[0] for cell in cells])


def properties(opened):
    """The numbers behind the pictures, by name."""
    (chunk,) = list(opened.stream().filter(content="/__properties/campaign"))
    batch = chunk.to_record_batch()
    return {name: batch[name].to_pylist()[0] for name in batch.schema.names}


def structure(opened):
    """Sorted lines: every entity with its timelines and components, without counts and factors."""
    lines = {
        re.sub(r"_x\d+", "_xN", re.sub(r" rows=\d+", "", line))
        for line in opened.summary().splitlines()
    }
    return sorted(line for line in lines if not line.endswith("cols=[]"))
