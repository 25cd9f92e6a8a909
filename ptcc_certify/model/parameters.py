"""Parameters as exact rationals: read, refused by name outside their domain, written short."""

from __future__ import annotations

import re
from dataclasses import fields, replace
from fractions import Fraction
from typing import Any, Self, overload

from ptcc_certify.errors import NumberError, ParameterError, gated
from ptcc_certify.graphs.declared_option import Option
from ptcc_certify.graphs.rationals import Exact, as_fraction, no_number, shorten

_SMALLEST, _LARGEST = Fraction(1, 10**300), Fraction(10**300)
#: Bits of the longest parameter, whose products are written in certificates.
LONGEST_BITS = 3000
_EXACT_TYPES = "Fraction | int | float | str"


class Positive:
    """A field of a frozen dataclass that takes any exact number and keeps it as a positive rational."""

    zero_allowed = False
    option: Option | None = None

    def __init__(self, default: Exact | None = None):
        self.default = default

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name
        owner.__annotations__[name] = _EXACT_TYPES  # what the constructor takes, for help()

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: object, owner: type) -> Fraction: ...
    def __get__(self, instance: Any, owner: type) -> Any:
        if instance is None:
            if self.default is None:
                raise AttributeError(self.name)
            return self.default
        return instance.__dict__[self.name]

    def __set__(self, instance: object, value: Exact) -> None:
        instance.__dict__[self.name] = parameter(self.name, value, self.zero_allowed)


class NotNegative(Positive):
    """The same where 0 is allowed."""

    zero_allowed = True


class Given:
    """The same where nothing may be given: then it is None."""

    default = None
    option: Option | None = None

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name
        owner.__annotations__[name] = f"{_EXACT_TYPES} | None"

    def __get__(self, instance: Any, owner: type) -> Fraction | None:
        return None if instance is None else instance.__dict__[self.name]

    def __set__(self, instance: object, value: Exact | None) -> None:
        instance.__dict__[self.name] = None if value is None else parameter(self.name, value, optional=True)


class Parameters:
    """What frozen dataclasses of such fields share."""

    @property
    def parameters(self) -> dict[str, Fraction]:
        """The parameters that are given, by their names."""
        every = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        return {name: value for name, value in every.items() if value is not None}

    @gated
    def replace(self, **changes: Exact) -> Self:
        """Return the same with other values of some parameters.

        Parameters
        ----------
        **changes : int, float, str or Fraction
            By the names of the parameters.

        Raises
        ------
        ParameterError
            No parameter is called so, or a value is outside its domain.

        Examples
        --------
        >>> NominalProtocol(T=1, rho1=1, rho2=1, kappa=2).replace(T=3)
        NominalProtocol(T=3, rho1=1, rho2=1, kappa=2)
        """
        return replace(self, **changes)  # type: ignore[type-var]

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={readable(x)}' for name, x in self.parameters.items())})"


def readable(value: Fraction) -> str:
    """Write a rational as short as it can be read back exactly: a float's decimals, or ``p/q``.

    Examples
    --------
    >>> readable(Fraction(0.6)), readable(Fraction(3, 5)), readable(Fraction(2))
    ('0.6', '3/5', '2')
    """
    if value.denominator != 1 and Fraction(float(value)) == value:
        return repr(float(value))
    return shorten(str(value))


def parameter(name: str, number: Any, zero_allowed: bool = False, optional: bool = False) -> Fraction:
    """Return a parameter as an exact rational, or refuse it by name; one that is ``optional`` may be left out.

    Examples
    --------
    >>> parameter("mu1", "1.2")
    Fraction(6, 5)
    >>> parameter("noise", 0, optional=True)
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: noise = 0 is outside its domain; leave it out for none
    """
    domain = ">= 0" if zero_allowed else "> 0"
    try:
        value = as_fraction(number, name)
    except NumberError as error:
        text = shorten(str(number))
        comma = isinstance(number, str) and re.fullmatch(r"\s*[-+]?\d+,\d+\s*", number)
        mend = f"write {text.strip().replace(',', '.')}" if comma else f"{name} must be a number {domain}"
        raise ParameterError(name, f"{no_number(number, error)}; {mend}") from None
    refuse_out_of_range(name, value)
    if value.numerator.bit_length() + value.denominator.bit_length() > LONGEST_BITS:
        raise ParameterError(name, "has too many digits for exact proofs; round it, to 17 digits say")
    if value < 0 or (value == 0 and not zero_allowed):
        mend = "leave it out for none" if optional and value == 0 else f"{name} must be {domain}"
        raise ParameterError(name, f"= {readable(value)} is outside its domain; {mend}")
    return value


def refuse_out_of_range(name: str, value: Fraction) -> None:
    """Refuse what leaves the range of float64 by far."""
    if value and not _SMALLEST <= abs(value) <= _LARGEST:
        raise ParameterError(name, "is not between 1e-300 and 1e300 in size; choose other units of time or weight")
