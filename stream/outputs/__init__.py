"""Where answers go: sinks, and the layouts that other programs understand."""

from kinespace.stream.outputs.layouts import LAYOUTS, Layout, LayoutSink, NativeLayout, ReplySink, WrittenLayout
from kinespace.stream.outputs.sink import Sink
from kinespace.stream.outputs.zeromq_sink import BodySink, ZmqSink
