"""What a certificate consists of: its parts, of one graph and of a family, and what each obligation brings."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Literal

from ptcc_certify.checker.agent_cascade import CascadeSection
from ptcc_certify.checker.agent_decrease import PhaseSection
from ptcc_certify.checker.agent_instants import InstantsSection
from ptcc_certify.checker.agents import AgentsSection
from ptcc_certify.checker.attracting_boxes import AttractingBox, KeptBox
from ptcc_certify.checker.common_forms import Multipliers
from ptcc_certify.checker.common_kernel_ends import Mean
from ptcc_certify.checker.constrained_switching import KeptMean, Section
from ptcc_certify.checker.delay_lmi import LateLMIWitness
from ptcc_certify.checker.delayed_forms import LateFormWitness, SettlingWitness
from ptcc_certify.checker.dominance import DominanceWitness
from ptcc_certify.checker.family import (
    Counterexample,
    FamilyClaim,
    FamilyComponent,
    KernelWitness,
)
from ptcc_certify.checker.final_state import AgentsVector, FormationSection, InfluenceSection
from ptcc_certify.checker.graph import FamilySection, GraphSection
from ptcc_certify.checker.input import EnergyWitness, InputSection, PeakWitness
from ptcc_certify.checker.lyapunov import FunctionSection, InertiaWitness, MeanWitness, OvershootSection, RatesSection
from ptcc_certify.checker.messages import MessagesSection, StepsStart
from ptcc_certify.checker.missed_deadline import Signs
from ptcc_certify.checker.protocol import NominalSection, ReachingTimes, SlidingSection
from ptcc_certify.checker.row_functions import FunctionOfFamily
from ptcc_certify.checker.section_declarations import (
    Agents,
    Ball,
    Brings,
    ByAgent,
    ByNumber,
    Ends,
    RowVector,
    Several,
    Sha256,
    Unread,
)
from ptcc_certify.checker.signal_bounds import FamilyInput
from ptcc_certify.checker.structure import ClaimSection, ComponentSection, ManyComponents, StructureSection
from ptcc_certify.checker.theorem_function import PaperSection
from ptcc_certify.checker.weighted_squares import FactorWitness


@dataclass(frozen=True, kw_only=True)
class AnyProblem:
    """What is asked: the gain of the protocol, and where the agents begin."""

    gain: NominalSection | SlidingSection
    initial_state: Agents | None = None
    sliding_variable: Agents | None = None


@dataclass(frozen=True, kw_only=True)
class GraphProblem(AnyProblem):
    """What is asked of one graph."""

    graph: GraphSection


@dataclass(frozen=True, kw_only=True)
class SignalProblem(AnyProblem):
    """What is asked of a family: what it does under every signal."""

    graph: FamilySection
    signal: Literal["any"]


@dataclass(frozen=True, kw_only=True)
class AnyCertificate:
    """What certificates of one graph and of a family have alike."""

    schema: Literal["ptcc-certificate/3"]
    producer: str
    structure: Several[StructureSection]
    reaching_time: ReachingTimes | None = None
    formation: FormationSection | None = None
    messages: MessagesSection | None = None
    proof: list[Any]
    digest: Sha256
    unverified: dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class OfAgents:
    """What a certificate of one graph says of agents of order n."""

    agents: AgentsSection | CascadeSection | None = None
    phases: Several[PhaseSection] | None = None
    instants: InstantsSection | None = None


@dataclass(frozen=True, kw_only=True)
class GraphCertificate(OfAgents, AnyCertificate):
    """A certificate of one graph."""

    problem: GraphProblem
    claim: ClaimSection | None = None
    components: Unread[Several[ComponentSection] | ManyComponents] | None = None
    paper: PaperSection | None = None
    decays: Several[FunctionSection]
    rates: RatesSection
    overshoot: OvershootSection | None = None
    influence: InfluenceSection | None = None
    final_state: Ends | None = None
    input: InputSection | None = None
    verdict: Literal["certified", "undecided"]


@dataclass(frozen=True, kw_only=True)
class FamilyCertificate(AnyCertificate):
    """A certificate of a family of graphs."""

    problem: SignalProblem
    claim: FamilyClaim | None = None
    components: Several[FamilyComponent] | None = None
    decays: Several[FunctionOfFamily]
    drives: Several[Fraction] | None = None
    final_state: ByAgent[Ball | None] | None = None
    input: FamilyInput
    verdict: Literal["certified"]
    boxes: Several[AttractingBox | KeptBox] | None = None
    restricted: Several[Section] | None = None


#: What an obligation of each kind brings, if anything; where there are several, one of them, as its numbers tell.
BRINGS: dict[str, tuple[Brings, ...]] = {
    "deviation-decrease": (Brings("b"),),
    "leader-decrease": (Brings("b"),),
    "leader-margin": (Brings("m"),),
    "margin": (Brings("m"), Brings("m rho")),
    "rho-interval": (Brings("printed exact"),),
    "rate": (Brings("b"),),
    "dominance": (Brings("b", DominanceWitness),),
    "overshoot": (Brings("lowest highest"),),
    "rate-mean": (Brings("upper_bound", MeanWitness),),
    "rate-upper-bound": (Brings("upper_bound", InertiaWitness),),
    "final-state": (Brings("", AgentsVector | None),),
    "input-threshold": (Brings("", Literal["rate", "upper_bound", "spectrum"]),),
    "input-peak": (Brings("z", PeakWitness),),
    "input-energy": (Brings("z", int), Brings("p m0 m1", EnergyWitness)),
    "input-length": (Brings("z", int),),
    "limited-gain": (Brings("growth", int | Several[int]),),
    "nominal-disturbed": (Brings("delta", int),),
    "late-rows": (Brings("q b", RowVector),),
    "late-steps": (Brings("", StepsStart),),
    "late-missed": (Brings("", Signs),),
    "late-settling": (Brings("q b", SettlingWitness),),
    "late-form": (Brings("q b kap", LateFormWitness),),
    "late-lmi": (Brings("b", LateLMIWitness),),
    "agent-decrease": (Brings("rate"),),
    "agent-coupling": (Brings("coupling"),),
    "agent-cascade": (Brings("alpha"),),
    "agent-phase": (Brings("rate"),),
    "family-claim": (Brings("", Several[KernelWitness | Counterexample | None]),),
    "family-rate": (Brings("b", Multipliers | None),),
    "family-rows": (Brings("b"),),
    "family-squares": (Brings("b", FactorWitness),),
    "family-final-state": (Brings("", Several[ByNumber[Mean] | None] | None),),
    "clock-shares": (Brings("", KeptMean | None),),
}
