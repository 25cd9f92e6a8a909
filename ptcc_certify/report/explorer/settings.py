"""What can be moved in the explorer, and what it is set to."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from ptcc_certify.errors import ParameterError
from ptcc_certify.lyapunov.search import METHODS
from ptcc_certify.model import Protocol

KINDS = ("nominal", "sliding-mode")
DISTURBANCES = ("none", "worst-case", "sin", "telegraph")
#: The name of a graph that is given without one, among those of the packaged ones.
GIVEN = "given graph"


@dataclass(frozen=True)
class Slider:
    """A parameter of a protocol that is moved.

    Attributes
    ----------
    begin : float
        Its value at first.
    meaning : str
    kind : {"nominal", "sliding-mode", ""}
        The protocol that it belongs to; both, if it is empty.
    least, largest, step : float
        In units of the parameter.
    """

    begin: float
    meaning: str
    kind: str = ""
    least: float = 0.05
    largest: float = 3.0
    step: float = 0.05


SLIDERS = {
    "T": Slider(1, "deadline", "nominal"),
    "T_r": Slider(0.5, "time to reach the manifold", "sliding-mode"),
    "T_s": Slider(0.5, "time on the manifold", "sliding-mode"),
    "rho1": Slider(1, "constant part of the gain"),
    "rho2": Slider(1, "growing part of the gain"),
    "kappa": Slider(2, "exponent of the time scaling", largest=5.0),
    "mu1": Slider(2, "switching gain, above delta", "sliding-mode", largest=5.0),
    "mu2": Slider(1, "constant part of the reaching gain", "sliding-mode"),
    "mu3": Slider(1, "growing part of the reaching gain", "sliding-mode"),
    "delta": Slider(1, "bound of every disturbance", "sliding-mode", least=0.0),
}
#: The largest seed that a slider reaches.
LARGEST_SEED = 99


class Settings:
    """What the controls are set to.

    Parameters
    ----------
    graph : str
        A packaged graph, or the name of the given one.
    kind : {"nominal", "sliding-mode"}
    reaching : bool
        Sliding mode: whether ``sigma(0)`` is random, or 0, which leaves no reaching phase.
    disturbance : {"none", "worst-case", "sin", "telegraph"}
        Sliding mode: what the simulated run meets; ``sin`` is ``delta sin(2 k t)``.
    seed : int
        Of the initial state, of ``sigma(0)`` and of telegraph signals: whole numbers from -9 to 9.
    method : {"best", "paper", "perron", "lmi", "full"}
        Classes of Lyapunov functions; see :mod:`ptcc_certify.lyapunov.search`.
    **parameters : number or str
        Parameters of the protocol: ``T, T_r, T_s, rho1, rho2, kappa, mu1, mu2, mu3, delta``; those of the other kind
        are ignored. A float is taken as the decimal of 12 digits that it stands for: 0.6 is 3/5.

    Raises
    ------
    ParameterError
        An unknown kind, disturbance, method or parameter, or a negative seed.

    Examples
    --------
    >>> Settings(T=0.6, rho2=0.3).protocol()
    NominalProtocol(T=3/5, rho1=1, rho2=3/10, kappa=2)
    """

    def __init__(
        self,
        graph: str = "fig3a",
        kind: str = "nominal",
        *,
        reaching: bool = True,
        disturbance: str = "worst-case",
        seed: int = 0,
        method: str = "best",
        **parameters: Any,
    ):
        self.graph, self.kind, self.reaching, self.disturbance = graph, kind, reaching, disturbance
        self.seed, self.method = seed, method
        self.parameters = {name: _decimal(parameters.get(name, slider.begin)) for name, slider in SLIDERS.items()}
        for name, known in (("kind", KINDS), ("disturbance", DISTURBANCES), ("method", METHODS)):
            refuse_unknown(name, getattr(self, name), known)
        for name in parameters:
            refuse_unknown("parameter", name, SLIDERS)
        if seed < 0:
            raise ParameterError("seed", f"= {seed} is outside its domain; seed must be >= 0")

    @classmethod
    def from_texts(cls, texts: Mapping[str, str]) -> Settings:
        """Return the settings that a form gives.

        Parameters
        ----------
        texts : mapping of str to str
            The settings by their names; ``reaching`` is ``"true"`` or ``"false"``.

        Raises
        ------
        ParameterError
            As for settings; the seed is no whole number.

        Examples
        --------
        >>> Settings.from_texts({"graph": "fig1a", "seed": "2", "reaching": "false", "T": "0.6"}).to_dict()["T"]
        '0.6'
        """
        values: dict[str, Any] = dict(texts)
        for name in values:
            refuse_unknown("setting", name, cls().to_dict())
        if "reaching" in values:
            refuse_unknown("reaching", values["reaching"], ("true", "false"))
            values["reaching"] = values["reaching"] == "true"
        if "seed" in values:
            if not values["seed"].isdecimal() or len(values["seed"]) > 18:
                raise ParameterError(f'seed "{values["seed"][:20]}" is not a whole number; give one from 0 on')
            values["seed"] = int(values["seed"])
        return cls(**values)

    def to_dict(self) -> dict[str, Any]:
        """Return all settings by their names, the parameters of the protocol among them."""
        own = {name: value for name, value in vars(self).items() if name != "parameters"}
        return own | self.parameters

    def changed(self, **changes: Any) -> Settings:
        """Return these settings but for some.

        Raises
        ------
        ParameterError
            As for new ones.
        """
        return Settings(**self.to_dict() | changes)

    @property
    def own(self) -> dict[str, Any]:
        """The parameters of the kind of protocol at hand."""
        return {name: value for name, value in self.parameters.items() if SLIDERS[name].kind in ("", self.kind)}

    @property
    def disturbance_text(self) -> str:
        """The disturbance as the command line takes it."""
        return f"{self.own['delta']}*sin(2*k*t)" if self.disturbance == "sin" else self.disturbance

    def protocol(self) -> Protocol:
        """Return the protocol.

        Raises
        ------
        ParameterError
            A parameter is outside its domain.
        """
        return Protocol.from_dict({"kind": self.kind} | self.own)


def refuse_unknown(name: str, value: str, choices: Iterable[str]) -> None:
    """Refuse a value that is none of some choices."""
    if value not in choices:
        raise ParameterError(f'{name} "{str(value)[:40]}" is unknown; one of {", ".join(choices)}')


def _decimal(value: Any) -> Any:
    """Return a float as a decimal of 12 digits: sliders give 0.15000000000000002 for 0.15."""
    return f"{value:.12g}" if isinstance(value, float) else value
