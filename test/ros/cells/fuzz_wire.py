# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Many messages in little time: they are made once and changed on the wire. A pool of whole messages is serialised; what is
sent is one of them with some of its numbers overwritten, and every other one with a stamp and a sequence that go on, as a
stream's do. Sizes and lengths stay right: bytes that are no message are another matter (docs/reference/safety.md)."""
import io
import random
import socket
import struct
import time
import xmlrpc.client

POOL = 400  # whole messages of a type
BATCH = 50  # messages in one write: half of the nodes' queues
FORMATS = {"bool": "<B", "byte": "<b", "char": "<B", "int8": "<b", "uint8": "<B", "int16": "<h", "uint16": "<H", "int32": "<i", "uint32": "<I",
           "int64": "<q", "uint64": "<Q", "float32": "<f", "float64": "<d", "time": "<II", "duration": "<ii"}
HEADER = [("seq", "uint32"), ("stamp", "time"), ("frame_id", "string")]


def spots_of(message):
    """(offset, kind, name) of each number of a serialised message."""
    spots = []

    def one(value, kind, offset, name):
        if kind == "string":
            return offset + 4 + len(value.encode() if isinstance(value, str) else value)
        if kind in FORMATS:
            spots.append((offset, kind, name))
            return offset + struct.calcsize(FORMATS[kind])
        return whole(value, offset)

    def whole(value, offset):
        for name, kind in zip(value.__slots__, value._slot_types):
            field = getattr(value, name)
            if kind.endswith("]"):
                element, size = kind[:-1].rsplit("[", 1)
                offset += 0 if size else 4
                for entry in field:
                    offset = one(entry, element, offset, name)
            else:
                offset = one(field, kind, offset, name)
        return offset

    return spots, whole(message, 0)


class Pool:
    """Serialised messages of one type, and how to change them."""

    def __init__(self, fuzzer, cls, seen, count):
        import genpy

        self.fuzzer, self.random, self.entries, self.steps = fuzzer, random.Random(fuzzer.random.random()), [], 0
        stamped = cls._slot_types[:1] == ["std_msgs/Header"]
        self.start = seen.header.stamp.to_sec() if stamped and seen is not None else 100.0
        while len(self.entries) < min(count, POOL):
            message = fuzzer.message(cls, seen)
            buffer = io.BytesIO()
            try:
                message.serialize(buffer)
            except (genpy.SerializationError, UnicodeError):
                continue  # no such message exists on the wire
            spots, size = spots_of(message)
            if size != len(buffer.getvalue()):
                raise AssertionError(f"{cls._type}: {size} bytes counted, {len(buffer.getvalue())} serialised")
            sequence = next((offset for offset, kind, name in spots if name == "sequence" and kind == "uint32"), None)
            self.entries.append((buffer.getvalue(), spots, stamped, sequence))

    def patch(self, data, offset, kind):
        values = self.fuzzer.pair(kind) if kind in ("time", "duration") else (self.fuzzer.scalar(kind),)
        struct.pack_into(FORMATS[kind], data, offset, *values)

    def message(self):
        """Bytes with their length before them."""
        blob, spots, stamped, sequence = self.random.choice(self.entries)
        data = bytearray(blob)
        for _ in range(self.random.randint(0, 3) if spots else 0):
            offset, kind, _ = self.random.choice(spots)
            self.patch(data, offset, kind)
        if stamped and self.random.random() < 0.5:
            self.steps += 1
            stamp = self.start + 0.02 * self.steps
            struct.pack_into("<II", data, 4, int(stamp), int(stamp % 1.0 * 1e9))
            if sequence is not None:
                struct.pack_into("<I", data, sequence, self.steps)
        return struct.pack("<I", len(data)) + data


class Taken:
    """How many of a publisher's (URI) messages nodes (URIs) have taken, without what their queues dropped. A node that
    reconnects, as the simulator in lockstep does to its participants, restarts its count: all are added."""

    def __init__(self, readers, topic, publisher):
        self.topic, self.publisher = topic, publisher
        self.taken = {uri: {} for uri in readers}

    def least(self):
        for uri, taken in self.taken.items():
            node = xmlrpc.client.ServerProxy(uri)
            ids = {entry[0] for entry in node.getBusInfo("/fuzz")[2] if entry[1] == self.publisher and entry[2] == "i" and entry[4] == self.topic}
            for name, connections in node.getBusStats("/fuzz")[1]:  # roscpp's: without a status before it
                taken.update({entry[0]: entry[2] - entry[3] for entry in connections if name == self.topic and entry[0] in ids})
        return min((sum(taken.values()) for taken in self.taken.values()), default=0)


class TopicSender:
    """Writes batches to all who subscribe, no faster than they take them."""

    def __init__(self, publisher, readers, topic, uri):
        self.publisher, self.received = publisher, Taken(readers, topic, uri)
        self.batch, self.pause, self.taken = BATCH, 0.001, 0
        for connection in list(publisher.impl.connections):  # otherwise single ones are gathered
            connection.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def send(self, pool, count):
        """At most two seconds between two looks. Messages sent."""
        end, sent = time.monotonic() + 2.0, 0
        while sent < count and time.monotonic() < end:
            part = min(self.batch, count - sent)
            data = b"".join(pool.message() for _ in range(part))
            for connection in list(self.publisher.impl.connections):
                connection.write_data(data)
            sent += part
            time.sleep(self.pause)
        return sent

    def adapt(self, share):
        """To a queue that has dropped all but `share`: a latched topic's often has one place."""
        if share < 0.7:
            self.pause *= 2.0 if self.batch == 1 else 1.0
            self.batch = max(1, self.batch // 3)
        elif share > 0.95:
            self.pause = max(0.0002, 0.7 * self.pause)
            self.batch = min(BATCH, self.batch + 1 + self.batch // 2)
        self.pause = min(self.pause, 0.05)

    def run(self, pool, count, budget):
        """Until each reader has taken `count`, or the budget [s] is spent. What the slowest has taken."""
        end = time.monotonic() + budget
        while self.taken < count and time.monotonic() < end:
            sent = self.send(pool, min(2000, count - self.taken))
            before, self.taken = self.taken, self.received.least()
            self.adapt((self.taken - before) / sent)
        return self.taken


CALLS_AHEAD = 200  # of a service, before the first is answered


class ServiceSender:
    """A service's connection that stays."""

    def __init__(self, uri, name, md5sum):
        host, port = uri[len("rosrpc://"):].rsplit(":", 1)
        self.socket = socket.create_connection((host, int(port)), 30.0)
        fields = ["callerid=/fuzz", f"service={name}", f"md5sum={md5sum}", "persistent=1"]
        header = b"".join(struct.pack("<I", len(field)) + field.encode() for field in fields)
        self.socket.sendall(struct.pack("<I", len(header)) + header)
        self.read(self.length())

    def read(self, count):
        data = b""
        while len(data) < count:
            # roscpp holds small answers back until those before them are acknowledged, which takes 40 ms else
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)
            part = self.socket.recv(min(65536, count - len(data)))
            if not part:
                raise OSError("connection closed")
            data += part
        return data

    def length(self):
        return struct.unpack("<I", self.read(4))[0]

    def run(self, pool, count, budget):
        """Calls that were answered within the budget [s], with yes or no. What takes long is called one by one."""
        end, done, ahead = time.monotonic() + budget, 0, 1
        self.socket.settimeout(budget + 60.0)
        while done < count and time.monotonic() < end:
            part, begun = min(ahead, count - done), time.monotonic()
            self.socket.sendall(b"".join(pool.message() for _ in range(part)))
            for _ in range(part):
                self.read(1)
                self.read(self.length())
                done += 1
            ahead = min(CALLS_AHEAD, 2 * ahead) if time.monotonic() - begun < 0.2 else max(1, ahead // 4)
        return done
