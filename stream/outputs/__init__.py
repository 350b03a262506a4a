"""Where answers go: sinks, and the layouts that other programs understand."""

from kinespace.stream.outputs.layouts import LAYOUTS, Layout, NativeLayout
from kinespace.stream.outputs.osc_sink import LayoutSink, ReplySender
from kinespace.stream.outputs.sink import Sink
from kinespace.stream.outputs.zeromq_sink import ZmqSink

__all__ = ["LAYOUTS", "Layout", "LayoutSink", "NativeLayout", "ReplySender", "Sink", "ZmqSink"]
