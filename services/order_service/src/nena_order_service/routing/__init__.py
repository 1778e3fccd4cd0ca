"""Routes over the plant model."""

from nena_order_service.routing.graph import CostEvaluator, CostKey, NoRouteError, Route, Step, evaluators
from nena_order_service.routing.router import Router

__all__ = [
    "CostEvaluator",
    "CostKey",
    "NoRouteError",
    "Route",
    "Router",
    "Step",
    "evaluators",
]
