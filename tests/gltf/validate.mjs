// GLB files come in as arguments, the Khronos validator's issues go out one a line; the exit status is 1 where any file
// has an issue that is not accepted below, 2 where there is nothing to do. What the files show is not judged here.
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
  try {
    const report = await validator.validateBytes(new Uint8Array(await readFile(path)), {
      uri: path,
      format: 'glb',
      maxIssues: 0,
      writeTimestamp: false,
    });
    messages = report.issues.messages;
  } catch (error) {
    messages = [{ severity: 0, code: 'UNREADABLE', message: String(error), pointer: '' }];
  }
  let bad = 0;
  for (const { severity, code, message, pointer = '' } of messages) {
    const accepted = severity >= INFORMATION && ACCEPTED.has(code);
    bad += accepted ? 0 : 1;
    console.log(`${path}: ${SEVERITIES[severity]}${accepted ? ' (accepted)' : ''}: ${code} ${pointer}: ${message}`);
  }
  console.log(`${path}: ${bad === 0 ? 'valid' : `${bad} issue(s) not accepted`}`);
  refused += bad;
}
process.exitCode = refused === 0 ? 0 : 1;
