"""Fault orders for tests."""

from netem.faults import FaultOrder, RadioEvent, RadioFault


def begin(number: int, fault: RadioFault, at_s: float = 0.0) -> FaultOrder:
    """Return the order that begins a fault."""
    return FaultOrder(number, at_s, RadioEvent.of(fault))


def end(number: int, at_s: float = 0.0) -> FaultOrder:
    """Return the order that ends a fault."""
    return FaultOrder(number, at_s)
