// SPDX-License-Identifier: Apache-2.0
// That this links is the test: see CMakeLists.txt.
int main() { return 0; }
