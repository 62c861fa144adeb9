"""Records for tests, as a sound run would leave them."""

from shellform.records.optimisation import OptimisationRecord
from shellform.records.summary import DesignRecord, LoadRecord, ModelRecord, NetRecord, Summary, SurfaceRecord

SURFACE = SurfaceRecord("vault.py", 0.56, (0.9, 0.55, 0.21), 9775)
MODEL = ModelRecord(1539, 1683, 290, 9234)
NET = NetRecord(
    spacing=0.055,
    crossings=176,
    rods=32,
    supports=64,
    spacing_v=0.055,
    distance_max=1e-4,
    distance_mean=3e-5,
    spacing_error_max=0.004,
    shear_angle_min=1.2,
    curvature_max=4.5,
    curvature_out_of_plane_max=3.9,
    curvature_in_plane_max=2.4,
    pull_max=0.01,
    pull_mean=0.003,
    uncovered_area=0.0,
    gaussian_curvature=2.1,
    factorisations=28,
    rod_radius_max=0.00143,
)
_DEVIATIONS = {
    "none": (0.0, 0.002, 0.001, 0.0012),
    "design": (1.0, 0.004, 0.002, 0.0024),
    "additional": (1.2, 0.008, 0.003, 0.004),
}


def load(name, **changes):
    """A load case under which all is well."""
    factor, largest, mean, rms = _DEVIATIONS[name]
    given = {
        "factor": factor,
        "deviation_max": largest,
        "deviation_mean": mean,
        "deviation_rms": rms,
        "stable": True,
        "rod_utilisation_max": 0.8,
        "residual": 1e-10,
    }
    return LoadRecord(**{**given, **changes})


def design(changed=None, /, **changes):
    """A sound design under three loads, with one load's record changed, or its own."""
    loads = {name: load(name, **(changes if name == changed else {})) for name in _DEVIATIONS}
    own = {} if changed else changes
    return DesignRecord(
        **{
            "cables": 100,
            "rod_radius": 0.001,
            "cable_force_sum": 70.0,
            "cable_force_max": 7.0,
            "loads": loads,
            **own,
        }
    )


def optimisation(constraints=None, **changes):
    """An optimisation that ended well."""
    given = {
        "objective_start": 1.0,
        "objective_end": 0.4,
        "iterations": 1,
        "evaluations": 3,
        "equilibria": 9,
        "factorisations": 20,
        "status": "no better design",
        "constraints": constraints or {"cable_force": -0.65},
        "rejected": 1,
    }
    return OptimisationRecord(**{**given, **changes})


def summary(names, changed=None, constraints=None, **changes):
    """A run's summary with one load's record of the last design changed."""
    designs = {name: design() for name in names}
    designs[list(names)[-1]] = design(changed, **changes)
    return Summary(
        surface=SURFACE, net=NET, model=MODEL, designs=designs, optimisation=optimisation(constraints)
    )
