"""How good must the tracker be? The same robot and poses, measured with more and more noise.

Run it: python scenes/noise_sweep.py
"""

import truebed
from testbed.scenario.read import changed
from testbed.studies import load_scenario

NOISE_UM = (5.0, 10.0, 17.5, 35.0)


def sweep(replications: int = 60) -> list[tuple[float, float, float, float]]:
    """Per noise [um]: mean held-out error [mm], stated u [mm], share of true points inside."""
    quick = load_scenario("quick")
    rows = []
    for noise_um in NOISE_UM:
        scenario = changed(
            quick,
            {
                "tracker.position_um": noise_um,
                "tracker.rotation_mdeg": 11.0 * noise_um / 17.5,
                "identification.estimators": ["whitened"],
                "uncertainty.replications": replications,
            },
        )
        best = truebed.run(scenario).trials[0].estimates[0]
        compared, repeated = best.comparison, best.replications
        variance = compared.covariance[:, range(3), range(3)].sum(axis=1).mean()
        rows.append(
            (
                noise_um,
                compared.accuracy_after.mean * 1e3,
                variance**0.5 * 1e3,
                float(repeated.tool_coverage.mean()) if repeated else float("nan"),
            )
        )
    return rows


if __name__ == "__main__":
    print("noise um   mean error mm   stated u mm   truth inside 95 % regions")
    for noise, error, u, held in sweep():
        print(f"{noise:8.1f}   {error:13.4f}   {u:11.4f}   {held:.0%}")
