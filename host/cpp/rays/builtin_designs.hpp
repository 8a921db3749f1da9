// Designs as text, made by tools/builtin-designs: `edge`, and `edge` with finer vertices.
#pragma once

namespace colonnade::rays {

// clang-format off
inline constexpr char edgeDesign[] = R"(number vertexBits 16
number boxBits 7
number macBits 32
number gridBits 24
number gridFraction 5
number sceneBits 32
number coordinateBits 11
number mantissaBits 32
number weightBits 23
number distanceDigits 24
number shadeBits 18
number maxExponent 10
number boxPadLog 1
number normalBits 12
number normalFraction 11
number colourBits 12
number lightBits 16
number lightFraction 12
number etaFraction 13
number directionBits 45
number shearFraction 22
number shearDigits 22
number reciprocalFraction 18
number reciprocalDigits 18
number entrySlackShift 15
number entryBits 27
number barycentricBits 12
number radicandBits 32
number cosineFraction 16
number boxDistanceBits 19
number stepFraction 9
number stepReach 9
number nearFraction 3
number nearBits 12
number nodeBits 19
number rootBits 23
number bvh 1
number recordBits 256
number stackDepth 32
number depth 2097152
layout node nodes 243 3 0
layout node leaves 240 3 0
layout node first 219 21 0
layout node corner.x 202 17 0
layout node corner.y 185 17 0
layout node corner.z 168 17 0
layout node children[0].high.x 35 7 0
layout node children[0].high.y 28 7 0
layout node children[0].high.z 21 7 0
layout node children[0].low.x 14 7 0
layout node children[0].low.y 7 7 0
layout node children[0].low.z 0 7 0
layout node children[1].high.x 77 7 0
layout node children[1].high.y 70 7 0
layout node children[1].high.z 63 7 0
layout node children[1].low.x 56 7 0
layout node children[1].low.y 49 7 0
layout node children[1].low.z 42 7 0
layout node children[2].high.x 119 7 0
layout node children[2].high.y 112 7 0
layout node children[2].high.z 105 7 0
layout node children[2].low.x 98 7 0
layout node children[2].low.y 91 7 0
layout node children[2].low.z 84 7 0
layout node children[3].high.x 161 7 0
layout node children[3].high.y 154 7 0
layout node children[3].high.z 147 7 0
layout node children[3].low.x 140 7 0
layout node children[3].low.y 133 7 0
layout node children[3].low.z 126 7 0
layout nearPair format 254 2 0
layout nearPair isClear 253 1 0
layout nearPair material 245 8 0
layout nearPair unused 244 1 0
layout nearPair body.lowBits[0].u 237 1 0
layout nearPair body.lowBits[0].v 236 1 0
layout nearPair body.lowBits[1].u 239 1 0
layout nearPair body.lowBits[1].v 238 1 0
layout nearPair body.lowBits[2].u 241 1 0
layout nearPair body.lowBits[2].v 240 1 0
layout nearPair body.lowBits[3].u 243 1 0
layout nearPair body.lowBits[3].v 242 1 0
layout nearPair body.normals[0].u 166 10 1
layout nearPair body.normals[0].v 156 10 1
layout nearPair body.normals[1].u 186 10 1
layout nearPair body.normals[1].v 176 10 1
layout nearPair body.normals[2].u 206 10 1
layout nearPair body.normals[2].v 196 10 1
layout nearPair body.normals[3].u 226 10 1
layout nearPair body.normals[3].v 216 10 1
layout nearPair body.deltas[0].x 72 12 1
layout nearPair body.deltas[0].y 60 12 1
layout nearPair body.deltas[0].z 48 12 1
layout nearPair body.deltas[1].x 108 12 1
layout nearPair body.deltas[1].y 96 12 1
layout nearPair body.deltas[1].z 84 12 1
layout nearPair body.deltas[2].x 144 12 1
layout nearPair body.deltas[2].y 132 12 1
layout nearPair body.deltas[2].z 120 12 1
layout nearPair body.vertex.x 32 16 0
layout nearPair body.vertex.y 16 16 0
layout nearPair body.vertex.z 0 16 0
layout triangle format 254 2 0
layout triangle isClear 253 1 0
layout triangle material 245 8 0
layout triangle unused 210 35 0
layout triangle body.normals[0].u 155 11 1
layout triangle body.normals[0].v 144 11 1
layout triangle body.normals[1].u 177 11 1
layout triangle body.normals[1].v 166 11 1
layout triangle body.normals[2].u 199 11 1
layout triangle body.normals[2].v 188 11 1
layout triangle body.vertices[0].x 32 16 0
layout triangle body.vertices[0].y 16 16 0
layout triangle body.vertices[0].z 0 16 0
layout triangle body.vertices[1].x 80 16 0
layout triangle body.vertices[1].y 64 16 0
layout triangle body.vertices[1].z 48 16 0
layout triangle body.vertices[2].x 128 16 0
layout triangle body.vertices[2].y 112 16 0
layout triangle body.vertices[2].z 96 16 0
layout flatPair format 254 2 0
layout flatPair isClear 253 1 0
layout flatPair material 245 8 0
layout flatPair unused 192 53 0
layout flatPair body.vertices[0].x 32 16 0
layout flatPair body.vertices[0].y 16 16 0
layout flatPair body.vertices[0].z 0 16 0
layout flatPair body.vertices[1].x 80 16 0
layout flatPair body.vertices[1].y 64 16 0
layout flatPair body.vertices[1].z 48 16 0
layout flatPair body.vertices[2].x 128 16 0
layout flatPair body.vertices[2].y 112 16 0
layout flatPair body.vertices[2].z 96 16 0
layout flatPair body.vertices[3].x 176 16 0
layout flatPair body.vertices[3].y 160 16 0
layout flatPair body.vertices[3].z 144 16 0
layout farPair format 254 2 0
layout farPair isClear 253 1 0
layout farPair material 245 8 0
layout farPair body.signs[0].x 238 1 0
layout farPair body.signs[0].y 237 1 0
layout farPair body.signs[0].z 236 1 0
layout farPair body.signs[1].x 241 1 0
layout farPair body.signs[1].y 240 1 0
layout farPair body.signs[1].z 239 1 0
layout farPair body.signs[2].x 244 1 0
layout farPair body.signs[2].y 243 1 0
layout farPair body.signs[2].z 242 1 0
layout farPair body.normals[0].u 166 10 1
layout farPair body.normals[0].v 156 10 1
layout farPair body.normals[1].u 186 10 1
layout farPair body.normals[1].v 176 10 1
layout farPair body.normals[2].u 206 10 1
layout farPair body.normals[2].v 196 10 1
layout farPair body.normals[3].u 226 10 1
layout farPair body.normals[3].v 216 10 1
layout farPair body.deltas[0].x 72 12 0
layout farPair body.deltas[0].y 60 12 0
layout farPair body.deltas[0].z 48 12 0
layout farPair body.deltas[1].x 108 12 0
layout farPair body.deltas[1].y 96 12 0
layout farPair body.deltas[1].z 84 12 0
layout farPair body.deltas[2].x 144 12 0
layout farPair body.deltas[2].y 132 12 0
layout farPair body.deltas[2].z 120 12 0
layout farPair body.vertex.x 32 16 0
layout farPair body.vertex.y 16 16 0
layout farPair body.vertex.z 0 16 0
layout colours colours[0].r 24 12 0
layout colours colours[0].g 12 12 0
layout colours colours[0].b 0 12 0
layout colours colours[1].r 60 12 0
layout colours colours[1].g 48 12 0
layout colours colours[1].b 36 12 0
layout colours colours[2].r 96 12 0
layout colours colours[2].g 84 12 0
layout colours colours[2].b 72 12 0
layout colours colours[3].r 132 12 0
layout colours colours[3].g 120 12 0
layout colours colours[3].b 108 12 0
)";

inline constexpr char fineDesign[] = R"(number vertexBits 24
number boxBits 7
number macBits 32
number gridBits 32
number gridFraction 5
number sceneBits 40
number coordinateBits 11
number mantissaBits 32
number weightBits 31
number distanceDigits 32
number shadeBits 18
number maxExponent 18
number boxPadLog 1
number normalBits 12
number normalFraction 11
number colourBits 12
number lightBits 16
number lightFraction 12
number etaFraction 13
number directionBits 45
number shearFraction 30
number shearDigits 30
number reciprocalFraction 26
number reciprocalDigits 26
number entrySlackShift 23
number entryBits 35
number barycentricBits 12
number radicandBits 32
number cosineFraction 16
number boxDistanceBits 27
number stepFraction 9
number stepReach 9
number nearFraction 3
number nearBits 12
number nodeBits 19
number rootBits 31
number bvh 1
number recordBits 320
number stackDepth 32
number depth 2097152
layout node nodes 267 3 0
layout node leaves 264 3 0
layout node first 243 21 0
layout node corner.x 218 25 0
layout node corner.y 193 25 0
layout node corner.z 168 25 0
layout node children[0].high.x 35 7 0
layout node children[0].high.y 28 7 0
layout node children[0].high.z 21 7 0
layout node children[0].low.x 14 7 0
layout node children[0].low.y 7 7 0
layout node children[0].low.z 0 7 0
layout node children[1].high.x 77 7 0
layout node children[1].high.y 70 7 0
layout node children[1].high.z 63 7 0
layout node children[1].low.x 56 7 0
layout node children[1].low.y 49 7 0
layout node children[1].low.z 42 7 0
layout node children[2].high.x 119 7 0
layout node children[2].high.y 112 7 0
layout node children[2].high.z 105 7 0
layout node children[2].low.x 98 7 0
layout node children[2].low.y 91 7 0
layout node children[2].low.z 84 7 0
layout node children[3].high.x 161 7 0
layout node children[3].high.y 154 7 0
layout node children[3].high.z 147 7 0
layout node children[3].low.x 140 7 0
layout node children[3].low.y 133 7 0
layout node children[3].low.z 126 7 0
layout nearPair format 318 2 0
layout nearPair isClear 317 1 0
layout nearPair material 309 8 0
layout nearPair unused 304 5 0
layout nearPair body.lowBits[0].u 297 1 0
layout nearPair body.lowBits[0].v 296 1 0
layout nearPair body.lowBits[1].u 299 1 0
layout nearPair body.lowBits[1].v 298 1 0
layout nearPair body.lowBits[2].u 301 1 0
layout nearPair body.lowBits[2].v 300 1 0
layout nearPair body.lowBits[3].u 303 1 0
layout nearPair body.lowBits[3].v 302 1 0
layout nearPair body.normals[0].u 226 10 1
layout nearPair body.normals[0].v 216 10 1
layout nearPair body.normals[1].u 246 10 1
layout nearPair body.normals[1].v 236 10 1
layout nearPair body.normals[2].u 266 10 1
layout nearPair body.normals[2].v 256 10 1
layout nearPair body.normals[3].u 286 10 1
layout nearPair body.normals[3].v 276 10 1
layout nearPair body.deltas[0].x 104 16 1
layout nearPair body.deltas[0].y 88 16 1
layout nearPair body.deltas[0].z 72 16 1
layout nearPair body.deltas[1].x 152 16 1
layout nearPair body.deltas[1].y 136 16 1
layout nearPair body.deltas[1].z 120 16 1
layout nearPair body.deltas[2].x 200 16 1
layout nearPair body.deltas[2].y 184 16 1
layout nearPair body.deltas[2].z 168 16 1
layout nearPair body.vertex.x 48 24 0
layout nearPair body.vertex.y 24 24 0
layout nearPair body.vertex.z 0 24 0
layout triangle format 318 2 0
layout triangle isClear 317 1 0
layout triangle material 309 8 0
layout triangle unused 282 27 0
layout triangle body.normals[0].u 227 11 1
layout triangle body.normals[0].v 216 11 1
layout triangle body.normals[1].u 249 11 1
layout triangle body.normals[1].v 238 11 1
layout triangle body.normals[2].u 271 11 1
layout triangle body.normals[2].v 260 11 1
layout triangle body.vertices[0].x 48 24 0
layout triangle body.vertices[0].y 24 24 0
layout triangle body.vertices[0].z 0 24 0
layout triangle body.vertices[1].x 120 24 0
layout triangle body.vertices[1].y 96 24 0
layout triangle body.vertices[1].z 72 24 0
layout triangle body.vertices[2].x 192 24 0
layout triangle body.vertices[2].y 168 24 0
layout triangle body.vertices[2].z 144 24 0
layout flatPair format 318 2 0
layout flatPair isClear 317 1 0
layout flatPair material 309 8 0
layout flatPair unused 288 21 0
layout flatPair body.vertices[0].x 48 24 0
layout flatPair body.vertices[0].y 24 24 0
layout flatPair body.vertices[0].z 0 24 0
layout flatPair body.vertices[1].x 120 24 0
layout flatPair body.vertices[1].y 96 24 0
layout flatPair body.vertices[1].z 72 24 0
layout flatPair body.vertices[2].x 192 24 0
layout flatPair body.vertices[2].y 168 24 0
layout flatPair body.vertices[2].z 144 24 0
layout flatPair body.vertices[3].x 264 24 0
layout flatPair body.vertices[3].y 240 24 0
layout flatPair body.vertices[3].z 216 24 0
layout farPair format 318 2 0
layout farPair isClear 317 1 0
layout farPair material 309 8 0
layout farPair unused 305 4 0
layout farPair body.signs[0].x 298 1 0
layout farPair body.signs[0].y 297 1 0
layout farPair body.signs[0].z 296 1 0
layout farPair body.signs[1].x 301 1 0
layout farPair body.signs[1].y 300 1 0
layout farPair body.signs[1].z 299 1 0
layout farPair body.signs[2].x 304 1 0
layout farPair body.signs[2].y 303 1 0
layout farPair body.signs[2].z 302 1 0
layout farPair body.normals[0].u 226 10 1
layout farPair body.normals[0].v 216 10 1
layout farPair body.normals[1].u 246 10 1
layout farPair body.normals[1].v 236 10 1
layout farPair body.normals[2].u 266 10 1
layout farPair body.normals[2].v 256 10 1
layout farPair body.normals[3].u 286 10 1
layout farPair body.normals[3].v 276 10 1
layout farPair body.deltas[0].x 104 16 0
layout farPair body.deltas[0].y 88 16 0
layout farPair body.deltas[0].z 72 16 0
layout farPair body.deltas[1].x 152 16 0
layout farPair body.deltas[1].y 136 16 0
layout farPair body.deltas[1].z 120 16 0
layout farPair body.deltas[2].x 200 16 0
layout farPair body.deltas[2].y 184 16 0
layout farPair body.deltas[2].z 168 16 0
layout farPair body.vertex.x 48 24 0
layout farPair body.vertex.y 24 24 0
layout farPair body.vertex.z 0 24 0
layout colours colours[0].r 24 12 0
layout colours colours[0].g 12 12 0
layout colours colours[0].b 0 12 0
layout colours colours[1].r 60 12 0
layout colours colours[1].g 48 12 0
layout colours colours[1].b 36 12 0
layout colours colours[2].r 96 12 0
layout colours colours[2].g 84 12 0
layout colours colours[2].b 72 12 0
layout colours colours[3].r 132 12 0
layout colours colours[3].g 120 12 0
layout colours colours[3].b 108 12 0
)";

// clang-format on

} // namespace colonnade::rays
