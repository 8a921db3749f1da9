// Parts of all units: arbiters, short rings, sets of contexts.
#pragma once
#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>

namespace colonnade::cycles {

using Cycle = std::int64_t;

/// common/Arbitration.scala.
class RoundRobin {
public:
    /// The bit of the request that is granted, or -1.
    int grant(std::uint32_t requests) const {
        if (requests == 0) return -1;
        const std::uint32_t ahead = requests & after_;
        return __builtin_ctz(ahead ? ahead : requests);
    }
    void take(int granted) { after_ = granted == 31 ? 0 : ~std::uint32_t(0) << (granted + 1); }

private:
    std::uint32_t after_ = 0;
};

/// A ring of at most `size` items.
template <class T, std::size_t size> class Ring {
public:
    bool isEmpty() const { return count_ == 0; }
    std::size_t count() const { return count_; }
    T& front() { return items_[head_]; }
    const T& front() const { return items_[head_]; }
    T& at(std::size_t i) { return items_[(head_ + i) & (size - 1)]; }
    const T& at(std::size_t i) const { return items_[(head_ + i) & (size - 1)]; }
    void push(const T& item) {
        assert(count_ < size);
        items_[(head_ + count_++) & (size - 1)] = item;
    }
    void pop() {
        assert(count_ > 0);
        head_ = (head_ + 1) & (size - 1);
        --count_;
    }

private:
    static_assert((size & (size - 1)) == 0);
    std::array<T, size> items_{};
    std::size_t head_ = 0, count_ = 0;
};

/// A fixed delay: items in order, each with the cycle from which it is there.
template <class T, std::size_t size> struct Delayed {
    struct Item {
        Cycle at;
        T value;
    };
    Ring<Item, size> items;

    void push(Cycle at, const T& value) { items.push({at, value}); }
    bool has(Cycle now) const { return !items.isEmpty() && items.front().at <= now; }
    const T& front() const { return items.front().value; }
    void pop() { items.pop(); }
    std::size_t count() const { return items.count(); }
    bool isEmpty() const { return items.isEmpty(); }
};

/// A set of numbers below 256.
class Set {
public:
    void add(int i) { words_[static_cast<std::size_t>(i) >> 6] |= bit(i); }
    void remove(int i) { words_[static_cast<std::size_t>(i) >> 6] &= ~bit(i); }
    bool has(int i) const { return words_[static_cast<std::size_t>(i) >> 6] & bit(i); }

    /// The lowest but `except`, or -1.
    int first(int except = -1) const {
        for (std::size_t w = 0; w < words_.size(); ++w) {
            std::uint64_t word = words_[w];
            if (except >= 0 && static_cast<std::size_t>(except) >> 6 == w) word &= ~bit(except);
            if (word) return static_cast<int>(64 * w) + __builtin_ctzll(word);
        }
        return -1;
    }

private:
    static std::uint64_t bit(int i) { return std::uint64_t(1) << (i & 63); }
    std::array<std::uint64_t, 4> words_{};
};

/// A claim that is served next (common/Arbitration.scala): of many, chosen a cycle early.
class Choice {
public:
    explicit Choice(bool isRegistered) : isRegistered_(isRegistered) {}

    /// The claim of this cycle, or -1. To be called before claims change in this cycle.
    int now(const Set& claims) {
        if (!isRegistered_) return chosen_ = claims.first();
        following_ = claims.first(chosen_);
        return chosen_;
    }
    void end(bool isServed) {
        if (isRegistered_ && (chosen_ < 0 || isServed)) chosen_ = following_;
    }

private:
    bool isRegistered_;
    int chosen_ = -1, following_ = -1;
};

} // namespace colonnade::cycles
