from __future__ import annotations

import subprocess
import sys

import pytest

from nena_shared.extensions.tracing import (
    TraceContext,
    TracingSettings,
    open_export,
    order_name_of,
    order_span_id,
    trace_id_of,
    vda_order_span_id,
)
from nena_shared.settings import ConfigurationError


@pytest.mark.parametrize(
    ("order_id", "name"),
    [
        ("T-1-0", "T-1"),
        ("T-1-12~3", "T-1"),
        ("TOrder-0199af3c-4-0", "TOrder-0199af3c-4"),
        ("evasion-7f37e9cd", "evasion-7f37e9cd"),
        ("wms/order 7", "wms/order 7"),
    ],
)
def test_the_transport_order_is_read_from_the_order_id(order_id: str, name: str) -> None:
    assert order_name_of(order_id) == name


def test_ids_stay_the_same_in_all_releases() -> None:
    """An edge agent may be of another release than the order service."""
    assert f"{trace_id_of('T-1'):032x}" == "ae842c9f24d2352bdaaa60e72311c65e"
    assert f"{order_span_id('T-1'):016x}" == "5ef8649e8aa13013"
    assert f"{vda_order_span_id('T-1-0'):016x}" == "c06fbc59dd6a375e"


def test_a_callers_context_without_a_trace_is_none() -> None:
    assert TraceContext.of(None) is None
    assert TraceContext.of(f"00-{0:032x}-{5:016x}-01") is None
    assert TraceContext.of(f"00-{4:032x}-{5:016x}-01") == TraceContext(4, 5)


def test_without_an_endpoint_nothing_is_loaded() -> None:
    program = (
        "import sys\n"
        "from nena_shared.extensions.tracing import TracingSettings, open_export\n"
        "assert open_export(TracingSettings(), 'nena-edge-agent') is None\n"
        "sys.stdout.write(' '.join(each for each in sys.modules if each.startswith('opentelemetry')))"
    )
    command = [sys.executable, "-c", program]
    assert subprocess.run(command, capture_output=True, text=True, check=True, timeout=90).stdout == ""


def test_a_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "nena_shared.extensions.tracing.export", None)
    settings = TracingSettings.model_validate({"endpoint": "http://127.0.0.1:4318/v1/traces"})
    with pytest.raises(ConfigurationError, match=r"install the extra nena-edge-agent\[tracing\]"):
        open_export(settings, "nena-edge-agent")
