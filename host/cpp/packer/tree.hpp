/// The tree over a quantised mesh. Its leaves are pairs of triangles, or triangles.
#pragma once

#include "pairs.hpp"

namespace colonnade::packer {

/// The tree over quantised triangles.
inline bvh::Bvh buildTree(const QuantisedMesh& quantised, const FaceAttributes& attributes,
                          const RecordFormat& format) {
    std::vector<bvh::Box> boxes(quantised.faces.size());
    for (std::size_t i = 0; i < boxes.size(); ++i)
        for (int corner = 0; corner < 3; ++corner) {
            const Units at = quantised.corner(i, corner);
            boxes[i].add({at, at});
        }
    const Pairing pairing(quantised, attributes, format);
    const std::vector<bvh::LeafTriangles> leaves = Matching(quantised, boxes, pairing).leaves();
    return bvh::build(boxes, leaves, static_cast<unsigned>(format.children), static_cast<unsigned>(format.boxBits),
                      static_cast<unsigned>(format.stackDepth), static_cast<unsigned>(attributes.leafRecords()));
}

} // namespace colonnade::packer
