// Masks of 32 bits by the device's, which have 8.
#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

namespace colonnade::rays {

/// A bit stands for the meshes that have it. The device keeps its own 8 bits if each other one stands for the same
/// meshes as one of them, or for none. Else it has a bit for each set of meshes; of more than 8 sets, all meshes of a
/// mask have all bits.
class MaskMap {
public:
    MaskMap() : MaskMap(std::vector<std::uint32_t>()) {}
    explicit MaskMap(const std::vector<std::uint32_t>& meshes) {
        std::vector<std::vector<bool>> sets(bits);
        for (unsigned bit = 0; bit < bits; ++bit)
            for (const std::uint32_t mask : meshes) sets[bit].push_back(mask >> bit & 1);
        std::vector<std::vector<bool>> own(sets.begin(), sets.begin() + deviceBits);
        if (assign(sets, own)) return;
        own.clear();
        for (const std::vector<bool>& set : sets)
            if (!isEmpty(set) && std::find(own.begin(), own.end(), set) == own.end()) own.push_back(set);
        isExact_ = own.size() <= deviceBits && assign(sets, own);
    }

    /// Whether the device tells all masks apart; else it finds hits that the host refuses.
    bool isExact() const { return isExact_; }

    /// The device's mask of a mesh or a ray.
    std::uint8_t of(std::uint32_t mask) const {
        if (!isExact_) return mask ? 0xff : 0;
        if (mask == UINT32_MAX) return ofAll_;
        std::uint8_t result = 0;
        for (; mask != 0; mask &= mask - 1) result |= ofBit_[__builtin_ctz(mask)];
        return result;
    }

private:
    static constexpr unsigned bits = 32, deviceBits = 8;

    static bool isEmpty(const std::vector<bool>& set) { return std::find(set.begin(), set.end(), true) == set.end(); }

    /// Gives each bit its set's; false if a set is missing.
    bool assign(const std::vector<std::vector<bool>>& sets, const std::vector<std::vector<bool>>& own) {
        for (unsigned bit = 0; bit < bits; ++bit) {
            const bool isOwn = own.size() == deviceBits && bit < deviceBits && own[bit] == sets[bit];
            const auto found = isOwn ? own.begin() + bit : std::find(own.begin(), own.end(), sets[bit]);
            if (found == own.end() && !isEmpty(sets[bit])) return false;
            ofBit_[bit] = found == own.end() ? 0 : static_cast<std::uint8_t>(1u << (found - own.begin()));
        }
        ofAll_ = 0;
        for (const std::uint8_t bit : ofBit_) ofAll_ |= bit;
        return true;
    }

    std::uint8_t ofBit_[bits]{}, ofAll_ = 0;
    bool isExact_ = true;
};

} // namespace colonnade::rays
