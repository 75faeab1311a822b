// SPDX-License-Identifier: GPL-3.0-or-later
// Reads an MCAP file with the reference reader @mcap/core, by its index and as a stream, with all checksums, and prints
// one line per message: topic, log time, JSON. The first line has schemas and statistics.
// Usage: WRENCHD_TEST_LIBRARIES=DIRECTORY node read_mcap.mjs FILE
import assert from "node:assert/strict";
import { createRequire } from "node:module";
import { open, readFile } from "node:fs/promises";
import path from "node:path";

const require = createRequire(path.join(process.env.WRENCHD_TEST_LIBRARIES, "node_modules", "x.js"));
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");

const name = process.argv[2];
const file = await open(name);
const readable = {
  size: async () => BigInt((await file.stat()).size),
  read: async (offset, length) => {
    const bytes = new Uint8Array(Number(length));
    const { bytesRead } = await file.read(bytes, 0, bytes.length, Number(offset));
    assert.equal(bytesRead, bytes.length);
    return bytes;
  },
};
const text = (bytes) => new TextDecoder().decode(bytes);

const indexed = await McapIndexedReader.Initialize({ readable });
const schemas = Object.fromEntries([...indexed.schemasById.values()].map((s) => [s.name, JSON.parse(text(s.data))]));
const topics = Object.fromEntries([...indexed.channelsById.values()].map((c) => [c.topic, indexed.schemasById.get(c.schemaId).name]));
const lines = [];
let before = 0n;
for await (const message of indexed.readMessages({ validateCrcs: true })) {
  assert.ok(message.logTime >= before, "messages are in the order of their times");
  before = message.logTime;
  lines.push([indexed.channelsById.get(message.channelId).topic, message.logTime, text(message.data)].join("\t"));
}

// The same messages without the index. The stream checks the checksums of chunks, data section and summary.
const stream = new McapStreamReader({ validateCrcs: true });
stream.append(await readFile(name));
let streamed = 0, dataEnd = null, footer = null;
for (let record; (record = stream.nextRecord()); ) {
  if (record.type === "Message") ++streamed;
  if (record.type === "DataEnd") dataEnd = record;
  if (record.type === "Footer") footer = record;
}
assert.ok(stream.done(), "the file is complete");
assert.equal(streamed, lines.length);
assert.notEqual(dataEnd.dataSectionCrc, 0);
assert.notEqual(footer.summaryCrc, 0);
assert.equal(Number(indexed.statistics.messageCount), lines.length);

process.stdout.write(JSON.stringify({ schemas, topics, messages: lines.length, chunks: indexed.statistics.chunkCount }) + "\n");
for (let i = 0; i < lines.length; i += 1000) process.stdout.write(lines.slice(i, i + 1000).join("\n") + "\n");
await file.close();
