// A query of an RTL spec and its reply: integers in a line of text.
#pragma once
#include <algorithm>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "model/traversal.hpp"

namespace colonnade {

class Query {
public:
    explicit Query(std::istream& words) : words_(words) {}
    Wide wide() {
        std::string word;
        if (!(words_ >> word)) throw std::invalid_argument("a query has too few values");
        const bool isNegative = word[0] == '-';
        UnsignedWide value = 0;
        for (std::size_t i = isNegative; i < word.size(); ++i)
            value = value * 10 + static_cast<unsigned>(word[i] - '0');
        return isNegative ? -static_cast<Wide>(value) : static_cast<Wide>(value);
    }
    std::int64_t number() { return static_cast<std::int64_t>(wide()); }
    Vector vector() {
        Vector v;
        for (auto& component : v) component = number();
        return v;
    }
    WideVector wideVector() {
        WideVector v;
        for (auto& component : v) component = wide();
        return v;
    }

private:
    std::istream& words_;
};

inline void readOrientation(Query& query, Ray& ray) {
    ray.enters = true;
    ray.axis = static_cast<int>(query.number());
    for (auto& sign : ray.negative) sign = query.number() != 0;
}

inline Ray readTriangleRay(Query& query) {
    Ray ray{};
    readOrientation(query, ray);
    ray.origin = query.vector();
    for (auto& shear : ray.shear) shear = query.number();
    return ray;
}

/// The bytes of records, which are hexadecimal words, the last digits first; and their number.
inline std::pair<std::vector<std::uint8_t>, std::size_t> readRecordBytes(std::istream& words) {
    std::vector<std::uint8_t> bytes;
    std::size_t count = 0;
    for (std::string digits; words >> digits; ++count)
        for (std::size_t end = digits.size(); end > 0; end -= 2)
            bytes.push_back(static_cast<std::uint8_t>(std::stoi(digits.substr(end - 2, 2), nullptr, 16)));
    if (count == 0) throw std::invalid_argument("the scene has no records");
    return {bytes, count};
}

class Reply {
public:
    Reply& operator<<(Wide value) {
        std::string digits;
        for (UnsignedWide rest = magnitude(value); rest != 0 || digits.empty(); rest /= 10)
            digits += static_cast<char>('0' + static_cast<int>(rest % 10));
        if (value < 0) digits += '-';
        std::reverse(digits.begin(), digits.end());
        text_ += text_.empty() ? digits : " " + digits;
        return *this;
    }
    template <class Values> Reply& all(const Values& values) {
        for (const auto value : values) *this << static_cast<Wide>(value);
        return *this;
    }
    void print() const { std::cout << text_ << '\n'; }

private:
    std::string text_;
};

} // namespace colonnade
