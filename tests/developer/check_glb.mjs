// SPDX-License-Identifier: Apache-2.0
// Runs the Khronos glTF validator on GLB files: node tests/developer/check_glb.mjs night/*.glb
// Fails on errors and warnings; remarks are printed. The validator comes from npm into a temporary folder, once.
import {execFileSync} from 'node:child_process';
import {existsSync, mkdirSync, readFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import {tmpdir} from 'node:os';
import {join} from 'node:path';

const version = '2.0.0-dev.3.10';
const folder = join(tmpdir(), `npsim-gltf-validator-${version}`);
if (!existsSync(join(folder, 'node_modules', 'gltf-validator'))) {
  mkdirSync(folder, {recursive: true});
  execFileSync('npm', ['install', '--prefix', folder, '--no-audit', '--no-fund', `gltf-validator@${version}`],
               {stdio: 'inherit'});
}
const validator = createRequire(join(folder, 'package.json'))('gltf-validator');

const files = process.argv.slice(2);
if (files.length === 0) {
  console.error('usage: node check_glb.mjs FILE.glb ...');
  process.exit(2);
}
let failed = false;
for (const file of files) {
  const {issues, info} = await validator.validateBytes(new Uint8Array(readFileSync(file)), {maxIssues: 20});
  console.log(`${file}: ${issues.numErrors} errors, ${issues.numWarnings} warnings, ${issues.numInfos} infos, ` +
              `${issues.numHints} hints; ${info.drawCallCount} parts, ${info.materialCount} materials, ` +
              `${info.totalVertexCount} vertices, ${info.totalTriangleCount} triangles`);
  for (const m of issues.messages) console.log(`  ${m.code} ${m.pointer ?? ''}: ${m.message}`);
  failed = failed || issues.numErrors > 0 || issues.numWarnings > 0;
}
process.exit(failed ? 1 : 0);
