"""Records of a campaign made one by one, for tests that look at single records or change them."""

from dataclasses import replace

from testbed.scenario.hashes import record_hash as hash_of
from testbed.studies import all_studies
from testbed.studies.protocol import Records, Task
from testbed.studies.trial.records import campaign_of


def planned(scenario):
    """Every record of a scenario with its study, by key."""
    return {
        record.key: (study, record)
        for study in all_studies(scenario)
        for record in study.records(scenario)
    }


def record_keys(scenario):
    """Keys of all records, in the usual order."""
    return tuple(planned(scenario))


def compute(scenario, key, get):
    """Make one record in all its pieces; `get` hands over another one by key."""
    study, record = planned(scenario)[key]
    needed = Records({other: get(other) for other in record.needs}, {})
    if record.cut is None:
        return study.play(scenario, Task(study.name, (key,)), needed)
    tasks = (Task(study.name, (key,), k, record.cut.block(k)) for k in range(record.cut.count))
    parts = [study.play(scenario, task, needed)[key] for task in tasks]
    return parts[0] if len(parts) == 1 else study.gather(scenario, key, parts)


def record_hash(scenario, robot, key):
    """Hash of what one record depends on."""
    return hash_of(planned(scenario)[key][1].reads, robot, key)


def made(scenario, order=None):
    """Records by key, made in `order`; by default all in their own."""
    records = {}

    def get(key):
        if key not in records:
            records[key] = compute(scenario, key, get)
        return records[key]

    for key in order or record_keys(scenario):
        get(key)
    return records


def played(scenario):
    """The campaign of a scenario, played in memory."""
    return gather(scenario, made(scenario).__getitem__)


def gather(scenario, get):
    """The campaign of all records."""
    return campaign_of(scenario, Records({key: get(key) for key in record_keys(scenario)}, {}))


def with_records(campaign, **changes):
    """The campaign with other records, `a__b` for the key ``a.b``; None takes one away."""
    values = dict(campaign.records.values)
    for name, record in changes.items():
        key = name.replace("__", ".")
        values.pop(key, None)
        if record is not None:
            values[key] = record
    return replace(campaign, records=Records(values, campaign.records.failed))


def without(campaign, *keys):
    """The campaign without some records; a key that ends in a dot takes all that begin so."""
    kept = {
        name: record
        for name, record in campaign.records.values.items()
        if not any(name == key or (key.endswith(".") and name.startswith(key)) for key in keys)
    }
    return replace(campaign, records=Records(kept, campaign.records.failed))
