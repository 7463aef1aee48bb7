// SPDX-License-Identifier: GPL-2.0-or-later
// Reads an MCAP file by its format's own library, by the index and then from front to end, with all CRCs checked, and
// prints what it found as JSON. Usage: node read_by_mcap_core.mjs FILE, beside node_modules.
import { openSync, readSync, fstatSync, readFileSync } from "fs";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import * as zstd from "@foxglove/wasm-zstd";

await zstd.isLoaded;
const decompressHandlers = { zstd: (bytes, size) => zstd.decompress(bytes, Number(size)) };
const path = process.argv[2];
const file = openSync(path);
const readable = {
  size: async () => BigInt(fstatSync(file).size),
  read: async (offset, size) => {
    const bytes = Buffer.alloc(Number(size));
    readSync(file, bytes, 0, Number(size), Number(offset));
    return new Uint8Array(bytes);
  },
};

const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
const topics = {};
for await (const message of reader.readMessages({ validateCrcs: true })) {
  const channel = reader.channelsById.get(message.channelId);
  topics[channel.topic] = (topics[channel.topic] ?? 0) + 1;
  if (channel.messageEncoding === "json") JSON.parse(new TextDecoder().decode(message.data));

}
const attachments = [];
for await (const one of reader.readAttachments({ validateCrcs: true })) attachments.push(one.name);

const streamed = new McapStreamReader({ decompressHandlers, validateCrcs: true });
streamed.append(readFileSync(path));
let count = 0, ended = false;
for (let record; (record = streamed.nextRecord()); ) {
  if (record.type === "Message") ++count;
  if (record.type === "Footer") ended = true;
}
console.log(JSON.stringify({ topics, attachments, streamed: count, ended,
  counted: Number(reader.statistics.messageCount), chunks: reader.chunkIndexes.length }));
