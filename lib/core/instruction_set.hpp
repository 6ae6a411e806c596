#pragma once

namespace tunica {

/// The instructions that this library was compiled for: "x86-64-v3" (those with AVX2), "x86-64" (every 64-bit PC), or
/// "other". A packaged library is there for both, and the system takes the one that its processor can run. Meshes are
/// the same with both: v3 is used without fused multiply-add. Simulations agree to round-off.
const char* instruction_set();

}  // namespace tunica
