"""Keywords of commands and methods, with types. Written by tools/python-options: do not change it by hand.

``PlanGiven`` has what the method for ``elastocal plan`` takes besides its own parameters, ``PlanOptions`` all options; ``Common`` is of
every command with a scenario.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, Protocol, TypedDict, overload

from typing_extensions import Unpack

from ._data import FilePath
from ._results import Results


class Common(TypedDict, total=False):
    allow: str | Sequence[str] | None
    noise_only: bool | None
    seed: int | None
    threads: int | None


class BudgetGiven(Common, total=False):
    by_minutes: bool | None
    candidates: FilePath | None
    draw: int | None
    no_proof: bool | None
    parameters: Literal["frames", "zeros", "links", "geometry", "compliances", "springs", "payload", "all"] | Sequence[Literal["frames", "zeros", "links", "geometry", "compliances", "springs", "payload", "all"]] | None
    plot_out: FilePath | None
    proof_out: FilePath | None
    prove: float | str | None
    prove_time: float | str | None


class BudgetOptions(BudgetGiven, total=False):
    accuracy_um: float | None
    up_to: int | None


class CheckGiven(Common, total=False):
    parameters: bool | None


class CheckOptions(CheckGiven, total=False):
    plan: FilePath | None


class CompareGiven(TypedDict, total=False):
    allow: str | Sequence[str] | None
    allow_different: Literal["schema", "scenario", "seed", "experiments", "configurations", "criterion", "trials", "level", "plans", "errors", "inputs"] | Sequence[Literal["schema", "scenario", "seed", "experiments", "configurations", "criterion", "trials", "level", "plans", "errors", "inputs"]] | None
    exact: bool | None
    markdown: FilePath | None
    threads: int | None
    within: float | None


class CompensateGiven(Common, total=False):
    angles_out: FilePath | None
    dialect: str | None
    frame: Literal["base", "instrument"] | None
    method: Literal["linear", "nonlinear"] | None
    program_out: FilePath | None
    static_compliance: bool | None
    station: str | None
    tool: str | None
    workpiece: str | None


class CompensateOptions(CompensateGiven, total=False):
    identified: FilePath | None
    targets: FilePath | None


class EvaluateGiven(Common, total=False):
    budget_out: FilePath | None
    candidates: FilePath | None
    criterion: Literal["test-pose", "a", "d", "e", "g", "o1", "o2", "o3", "o4", "o5"] | None
    no_proof: bool | None
    parameters: Literal["frames", "zeros", "links", "geometry", "compliances", "springs", "payload", "all"] | Sequence[Literal["frames", "zeros", "links", "geometry", "compliances", "springs", "payload", "all"]] | None
    proof_out: FilePath | None
    prove: float | str | None
    prove_time: float | str | None
    report_out: FilePath | None
    static_compliance: bool | None
    test_poses: FilePath | None
    trials: int | None


class EvaluateOptions(EvaluateGiven, total=False):
    plan: FilePath | None


class ExplainGiven(TypedDict, total=False):
    threads: int | None


class ExportGiven(Common, total=False):
    joint_errors_out: FilePath | None


class ExportOptions(ExportGiven, total=False):
    identified: FilePath | None
    model_out: FilePath | None


class IdentifyGiven(Common, total=False):
    against: FilePath | None
    identified_out: FilePath | None
    joint_errors: Literal["auto", "on", "off"] | None
    keep_all: bool | None
    method: Literal["linear", "nonlinear"] | None
    model_selection: bool | None
    parameters: Literal["frames", "zeros", "links", "geometry", "compliances", "springs", "payload", "all"] | Sequence[Literal["frames", "zeros", "links", "geometry", "compliances", "springs", "payload", "all"]] | None
    plot_out: FilePath | None
    sigma_from_residuals: bool | None
    uncertainties_out: FilePath | None


class IdentifyOptions(IdentifyGiven, total=False):
    measurements: FilePath | None


class ImportGiven(TypedDict, total=False):
    measurements_out: FilePath | None
    threads: int | None


class ImportOptions(ImportGiven, total=False):
    mapping: FilePath | None


class InitGiven(TypedDict, total=False):
    threads: int | None
    tip: str | None


class InitOptions(InitGiven, total=False):
    scenario_out: FilePath | None


class LabGiven(Common, total=False):
    dialect: str | None
    keep_order: bool | None


class LabOptions(LabGiven, total=False):
    out: FilePath | None
    plan: FilePath | None


class MeasureGiven(Common, total=False):
    campaign: int | None
    measurements_out: FilePath | None
    noise_free: bool | None
    run: int | None
    series: int | None


class MeasureOptions(MeasureGiven, total=False):
    plan: FilePath | None


class MergeGiven(TypedDict, total=False):
    allow: str | Sequence[str] | None
    out: FilePath | None
    threads: int | None


class NextGiven(Common, total=False):
    accuracy_um: float | None
    candidates: FilePath | None
    draw: int | None
    experiments: int | None
    parameters: Literal["frames", "zeros", "links", "geometry", "compliances", "springs", "payload", "all"] | Sequence[Literal["frames", "zeros", "links", "geometry", "compliances", "springs", "payload", "all"]] | None
    plan_out: FilePath | None
    skip: int | Sequence[int] | None
    skip_within_deg: float | None


class NextOptions(NextGiven, total=False):
    measurements: FilePath | None
    plan: FilePath | None


class PlanGiven(Common, total=False):
    budget_out: FilePath | None
    candidates: FilePath | None
    configurations: int | None
    criterion: Literal["test-pose", "a", "d", "e", "g", "o1", "o2", "o3", "o4", "o5"] | None
    draw: int | None
    minutes: float | None
    no_proof: bool | None
    parameters: Literal["frames", "zeros", "links", "geometry", "compliances", "springs", "payload", "all"] | Sequence[Literal["frames", "zeros", "links", "geometry", "compliances", "springs", "payload", "all"]] | None
    plan_out: FilePath | None
    proof_out: FilePath | None
    prove: float | str | None
    prove_time: float | str | None
    report_out: FilePath | None
    stills_out: FilePath | None
    test_poses: FilePath | None


class PlanOptions(PlanGiven, total=False):
    experiments: int | None


class ReplayGiven(Common, total=False):
    candidates: FilePath | None
    draw: int | None
    parameters: Literal["frames", "zeros", "links", "geometry", "compliances", "springs", "payload", "all"] | Sequence[Literal["frames", "zeros", "links", "geometry", "compliances", "springs", "payload", "all"]] | None


class ReplayOptions(ReplayGiven, total=False):
    out: FilePath | None
    run: int | None


class ReproduceGiven(Common, total=False):
    trials: int | None


class ReproduceOptions(ReproduceGiven, total=False):
    out: FilePath | None


class RunGiven(Common, total=False):
    budget_out: FilePath | None
    candidates: FilePath | None
    draw: int | None
    no_proof: bool | None
    parameters: Literal["frames", "zeros", "links", "geometry", "compliances", "springs", "payload", "all"] | Sequence[Literal["frames", "zeros", "links", "geometry", "compliances", "springs", "payload", "all"]] | None
    proof_out: FilePath | None
    prove: float | str | None
    prove_time: float | str | None
    rerun: str | None


class RunOptions(RunGiven, total=False):
    out: FilePath | None


class SchemaGiven(TypedDict, total=False):
    threads: int | None


class SelectGiven(Common, total=False):
    campaigns: int | None
    draws: int | None
    parameters: Literal["frames", "zeros", "links", "geometry", "compliances", "springs", "payload", "all"] | Sequence[Literal["frames", "zeros", "links", "geometry", "compliances", "springs", "payload", "all"]] | None
    plot_out: FilePath | None
    sizes: int | Sequence[int] | None


class SelectOptions(SelectGiven, total=False):
    measurements: FilePath | None


class StudyGiven(Common, total=False):
    candidates: FilePath | None
    draw: int | None
    level: Literal["model", "robot"] | None
    parameters: Literal["frames", "zeros", "links", "geometry", "compliances", "springs", "payload", "all"] | Sequence[Literal["frames", "zeros", "links", "geometry", "compliances", "springs", "payload", "all"]] | None
    rerun: str | None
    resume: FilePath | None
    shard: str | None
    tally_out: FilePath | None
    trials: int | None


class StudyOptions(StudyGiven, total=False):
    out: FilePath | None


class ValidateGiven(Common, total=False):
    experiments: int | None
    guard_band: float | None
    plan_out: FilePath | None
    tolerance_um: float | None


class ValidateOptions(ValidateGiven, total=False):
    identified: FilePath | None
    measurements: FilePath | None


class Commands(Protocol):
    """Any command, with its options as keywords."""

    @overload
    def __call__(self, name: Literal["budget"], /, *positional: object, **given: Unpack[BudgetOptions]) -> Results: ...
    @overload
    def __call__(self, name: Literal["check"], /, *positional: object, **given: Unpack[CheckOptions]) -> Results: ...
    @overload
    def __call__(self, name: Literal["compare"], /, *positional: object, **given: Unpack[CompareGiven]) -> Results: ...
    @overload
    def __call__(self, name: Literal["compensate"], /, *positional: object, **given: Unpack[CompensateOptions]) -> Results: ...
    @overload
    def __call__(self, name: Literal["evaluate"], /, *positional: object, **given: Unpack[EvaluateOptions]) -> Results: ...
    @overload
    def __call__(self, name: Literal["explain"], /, *positional: object, **given: Unpack[ExplainGiven]) -> Results: ...
    @overload
    def __call__(self, name: Literal["export"], /, *positional: object, **given: Unpack[ExportOptions]) -> Results: ...
    @overload
    def __call__(self, name: Literal["identify"], /, *positional: object, **given: Unpack[IdentifyOptions]) -> Results: ...
    @overload
    def __call__(self, name: Literal["import"], /, *positional: object, **given: Unpack[ImportOptions]) -> Results: ...
    @overload
    def __call__(self, name: Literal["init"], /, *positional: object, **given: Unpack[InitOptions]) -> Results: ...
    @overload
    def __call__(self, name: Literal["lab"], /, *positional: object, **given: Unpack[LabOptions]) -> Results: ...
    @overload
    def __call__(self, name: Literal["measure"], /, *positional: object, **given: Unpack[MeasureOptions]) -> Results: ...
    @overload
    def __call__(self, name: Literal["merge"], /, *positional: object, **given: Unpack[MergeGiven]) -> Results: ...
    @overload
    def __call__(self, name: Literal["next"], /, *positional: object, **given: Unpack[NextOptions]) -> Results: ...
    @overload
    def __call__(self, name: Literal["plan"], /, *positional: object, **given: Unpack[PlanOptions]) -> Results: ...
    @overload
    def __call__(self, name: Literal["replay"], /, *positional: object, **given: Unpack[ReplayOptions]) -> Results: ...
    @overload
    def __call__(self, name: Literal["reproduce"], /, *positional: object, **given: Unpack[ReproduceOptions]) -> Results: ...
    @overload
    def __call__(self, name: Literal["run"], /, *positional: object, **given: Unpack[RunOptions]) -> Results: ...
    @overload
    def __call__(self, name: Literal["schema"], /, *positional: object, **given: Unpack[SchemaGiven]) -> Results: ...
    @overload
    def __call__(self, name: Literal["select"], /, *positional: object, **given: Unpack[SelectOptions]) -> Results: ...
    @overload
    def __call__(self, name: Literal["study"], /, *positional: object, **given: Unpack[StudyOptions]) -> Results: ...
    @overload
    def __call__(self, name: Literal["validate"], /, *positional: object, **given: Unpack[ValidateOptions]) -> Results: ...
