// GLB files come in as arguments, the Khronos validator's issues go out one a line, accepted ones as counts; the exit status is 1
// where any file has an issue that is not accepted below, 2 where there is nothing to do. What the files show is not judged here.
//
//   cargo test -p isolux-formats          (leaves GLB files in target/tmp)
//   npm ci --prefix tests/gltf
//   node tests/gltf/validate.mjs target/tmp/*.glb

import { readFile } from 'node:fs/promises';
import validator from 'gltf-validator';

// Informations (never errors or warnings) that a good file may cause, each with its reason.
const ACCEPTED = new Map([
  ['IMAGE_NPOT_DIMENSIONS', 'textures are carried along as they came, whatever their size'],
]);
// The same of files with lightmaps (MOZ_lightmap, which the validator does not know), by what the message names.
const ACCEPTED_WITH_LIGHTMAPS = [
  ['UNSUPPORTED_EXTENSION', /'MOZ_lightmap'/, 'there is no ratified extension; loaders read this one'],
  ['UNUSED_OBJECT', /TEXCOORD_\d+$/, 'the coordinates of lightmaps are used by MOZ_lightmap'],
  ['UNUSED_OBJECT', /^\/textures\/\d+$/, 'and so are their textures'],
];
const SEVERITIES = ['error', 'warning', 'information', 'hint'];
const INFORMATION = SEVERITIES.indexOf('information');

const paths = process.argv.slice(2);
if (paths.length === 0) {
  console.error('usage: node tests/gltf/validate.mjs FILE.glb ...');
  process.exit(2);
}

let refused = 0;
for (const path of paths) {
  let messages;
  let hasLightmaps = false;
  try {
    const report = await validator.validateBytes(new Uint8Array(await readFile(path)), {
      uri: path,
      format: 'glb',
      maxIssues: 0,
      writeTimestamp: false,
    });
    messages = report.issues.messages;
    hasLightmaps = report.info.extensionsUsed?.includes('MOZ_lightmap') ?? false;
  } catch (error) {
    messages = [{ severity: 0, code: 'UNREADABLE', message: String(error), pointer: '' }];
  }
  let bad = 0;
  const good = new Map();
  for (const { severity, code, message, pointer = '' } of messages) {
    const isOfLightmaps = ([known, names]) => code === known && names.test(code === 'UNUSED_OBJECT' ? pointer : message);
    const known = ACCEPTED.has(code) || (hasLightmaps && ACCEPTED_WITH_LIGHTMAPS.some(isOfLightmaps));
    const accepted = severity >= INFORMATION && known;
    if (accepted) {
      good.set(code, (good.get(code) ?? 0) + 1);
      continue;
    }
    bad += 1;
    console.log(`${path}: ${SEVERITIES[severity]}: ${code} ${pointer}: ${message}`);
  }
  for (const [code, count] of good) {
    console.log(`${path}: accepted: ${count} of ${code}`);
  }
  console.log(`${path}: ${bad === 0 ? 'valid' : `${bad} issue(s) not accepted`}`);
  refused += bad;
}
process.exitCode = refused === 0 ? 0 : 1;
