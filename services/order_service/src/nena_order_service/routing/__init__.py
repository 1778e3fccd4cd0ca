"""Routes over the plant model."""

from nena_order_service.routing.costs import CostEvaluator, CostKey, evaluators
from nena_order_service.routing.errors import NoRouteError
from nena_order_service.routing.route import Route, Step
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
