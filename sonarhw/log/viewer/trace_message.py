"""A trace as a protobuf message, which log viewers plot: /traces.level[:]. The exact samples are in the frames."""

from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

from sonarhw.readings import Trace

FULL_SCALE = 255
_Field = descriptor_pb2.FieldDescriptorProto
_FIELDS = (
    ("reading", _Field.TYPE_UINT32, False),  # number of the reading in its scan
    ("angle_deg", _Field.TYPE_DOUBLE, False),  # turntable angle
    ("rate_hz", _Field.TYPE_DOUBLE, False),
    ("start_s", _Field.TYPE_DOUBLE, False),  # from the start of transmission to the first sample
    ("carrier", _Field.TYPE_BOOL, False),
    ("level", _Field.TYPE_SINT32, True),  # full scale is 255; a lost sample repeats the one before it
    ("lost", _Field.TYPE_UINT32, True),  # indices of lost samples
)


def _message_class() -> type[Any]:
    file = descriptor_pb2.FileDescriptorProto(name="sonarhw/trace.proto", package="sonarhw", syntax="proto3")
    message = file.message_type.add(name="Trace")
    for number, (name, kind, repeated) in enumerate(_FIELDS, start=1):
        label = _Field.LABEL_REPEATED if repeated else _Field.LABEL_OPTIONAL
        message.field.add(name=name, number=number, type=kind, label=label)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("sonarhw.Trace"))


TraceMessage = _message_class()


def trace_message(reading: int, angle_deg: float, trace: Trace) -> Any:
    """Return the message of the trace of reading number `reading`, a `TraceMessage`."""
    lost = np.isnan(trace.samples)
    before = np.maximum.accumulate(np.where(lost, 0, np.arange(len(lost))))
    levels = np.nan_to_num(np.rint(trace.samples[before] * FULL_SCALE)).astype(int)
    return TraceMessage(
        reading=reading,
        angle_deg=angle_deg,
        rate_hz=trace.rate,
        start_s=trace.start,
        carrier=trace.carrier,
        level=levels.tolist(),
        lost=np.flatnonzero(lost).tolist(),
    )
