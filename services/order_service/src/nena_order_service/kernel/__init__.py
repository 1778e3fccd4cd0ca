"""The kernel: the one owner of orders, vehicles and missions; joins dispatcher, fleet control and store."""

from nena_order_service.kernel.kernel import Kernel
from nena_order_service.kernel.settings import KernelSettings

__all__ = ["Kernel", "KernelSettings"]
