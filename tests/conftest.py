"""What has to be set before numpy and numba are imported: threads, and the compiled solver's own cache."""

import json
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in Snakemake's jobs: tests run beside each other

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from hopperopt import provenance

os.environ.setdefault("NUMBA_NUM_THREADS", "4")  # more threads than cores are no harm

provenance.use_numba_cache()


def pytest_collection_modifyitems(items):
    """Whole studies first: what parallel processes would wait for at the end."""
    items.sort(key=lambda item: "workflow" not in item.path.parts)


@pytest.fixture(scope="session")
def make_report_study():
    """Function that returns the report's Study, of runs made without a simulation, and its cases."""
    from hopperopt import config, dataset, effects, outflow
    from hopperopt.report import page

    def run(case, status="complete"):
        rng = np.random.default_rng(case["seed"])
        size_class = np.arange(60) % 3
        place = np.column_stack([rng.uniform(-0.03, 0.03, (60, 2)), rng.uniform(0.03, 0.07, 60)])
        scalars = dict.fromkeys(dataset.RUN - {"exit_time", "diameter", "size_class"}, 0.5)
        return xr.Dataset(
            {
                **scalars,
                "filling_level": case["filling"]["level"],
                "particle_count": 60,
                "status": status,
                "exit_time": ("particle", rng.random(60)),
                "diameter": ("particle", np.array([0.002, 0.003, 0.004])[size_class]),
                "size_class": ("particle", size_class),
                "position_opening": (("particle", "xyz"), place),
                "position_half": (("particle", "xyz"), np.where(np.arange(60)[:, None] % 2, place, np.nan)),
            },
            attrs={
                "case": json.dumps(case), "seed": 7, "wall_time_s": 90.0, "particle_steps_per_s": 5e6,
                "git": "0123456789abcdef", "host": "machine", "created": "2030-01-02T03:04:05+00:00",
                "versions": '{"python": "3.11"}', "code_digest": "abc", "hopperopt_version": "1.0",
            },
        )  # fmt: skip

    def study(document=None, **changes):
        cases = {"selected": "selected", "plan_best": "plan_best", "bare": "bare"}
        few = {"verification": {"cases": cases, "replicates_of": {}}}
        whole = config.parse(few | (document or {}))
        params = whole.stage_params("report")
        designs = dict(whole.experiments())
        plan = {(name, 1): run(whole.simulation_case(d, name, 1)) for name, d in designs.items()}
        centre = designs[next(iter(designs))]
        anew = {
            (name, 1): run(whole.simulation_case(centre if isinstance(d, str) else d, name, 1))
            for name, d in whole.cases().items()
        }
        table = pd.DataFrame.from_dict(designs, orient="index")
        front = table.head(5).assign(feasible=True, selected=[True, *[False] * 4])
        front = front.assign(J_fine=np.linspace(0.01, 0.02, 5), J_intermediate=np.linspace(0.02, 0.01, 5))
        verdict = pd.DataFrame(
            [
                {"case": case, "objective": name, "n": 2, **VALUES, "verdict": "better"}
                for case in whole.cases()
                for name in outflow.SIZE_CLASSES[:2]
            ]
        )
        methods = dict.fromkeys(("curve_rmse_f", "curve_rmse_i", "objective_f_rmse"), 0.01)
        validation = pd.DataFrame(
            {"method": ["gaussian", "mean_curve"], **methods, "objective_i_rmse": 0.01, "coverage_90": 0.9}
        )
        data = dataset.assemble(table, plan, {}).assign_attrs(next(iter(plan.values())).attrs)
        made = page.Study(
            kinds=dict(params["cases"]),
            keys=params["derived"]["keys"],
            data=data,
            proposals=pd.DataFrame(),
            infill={},
            effects=effects.main_effects(data, list(designs[next(iter(designs))])),
            selected={"design": centre, "rule": "knee", "warning": None},
            front=front,
            verdict=verdict,
            validation=validation,
            surrogate=xr.Dataset(attrs={"surrogate": "gaussian"}),
            undetectable=[],
            plan=plan,
            verification=anew,
        )
        return made._replace(**changes), lambda design: whole.simulation_case(design, "front", 1)

    return study


VALUES = {
    "predicted": 0.011, "predicted_low": 0.009, "predicted_high": 0.013, "simulated": 0.012, "low": 0.01,
    "high": 0.014, "raw_rms": 0.02, "z": 0.5, "diff_bare": -6e-4, "diff_low": -9e-4, "diff_high": -3e-4,
    "p_holm": 0.003,
}  # fmt: skip
