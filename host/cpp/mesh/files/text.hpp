/// The bytes of text files: words, lines and numbers. Numbers are rounded once, as by every parser that is right, and
/// whatever the locale is.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace colonnade::mesh {

using Text = std::string_view;

inline bool isSpace(char one) { return one == ' ' || (one >= '\t' && one <= '\r'); }
inline bool isEnd(char one) { return one == '\n' || one == '\r'; }
inline bool isDigit(char one) { return one >= '0' && one <= '9'; }
inline char lower(char one) { return one >= 'A' && one <= 'Z' ? static_cast<char>(one + 'a' - 'A') : one; }
/// Whether a character is a letter, also beyond ASCII, a digit or an underscore.
inline bool isOfWord(char one) {
    return isDigit(one) || one == '_' || (lower(one) >= 'a' && lower(one) <= 'z') || (one & 0x80);
}
inline std::string lowered(Text text) {
    std::string found(text);
    std::transform(found.begin(), found.end(), found.begin(), lower);
    return found;
}
inline bool startsWith(Text text, Text with) { return text.substr(0, with.size()) == with; }

inline Text trimmed(Text text) {
    while (!text.empty() && isSpace(text.front())) text.remove_prefix(1);
    while (!text.empty() && isSpace(text.back())) text.remove_suffix(1);
    return text;
}

/// Words one after the other, between white space; a backslash at the end of a line is some, too.
class Words {
public:
    explicit Words(Text text) : at_(text.data()), end_(at_ + text.size()) {}

    /// The next word, empty after the last one.
    Text next() {
        while (at_ != end_ && (isSpace(*at_) || isBreak(at_))) ++at_;
        const char* first = at_;
        while (at_ != end_ && !isSpace(*at_) && !isBreak(at_)) ++at_;
        return {first, static_cast<std::size_t>(at_ - first)};
    }
    /// What follows the last word.
    Text rest() const { return {at_, static_cast<std::size_t>(end_ - at_)}; }

private:
    bool isBreak(const char* at) const { return *at == '\\' && at + 1 != end_ && isEnd(at[1]); }

    const char *at_, *end_;
};

inline std::vector<Text> wordsOf(Text text) {
    std::vector<Text> found;
    Words words(text);
    for (Text word = words.next(); !word.empty(); word = words.next()) found.push_back(word);
    return found;
}

template <class Range> std::string joined(const Range& words, Text between = " ") {
    std::string found;
    for (const auto& word : words) found.append(found.empty() ? Text() : between).append(word);
    return found;
}

/// Lines one after the other, whose ends are those of any system; with `joins` a backslash before its end continues
/// one.
class Lines {
public:
    explicit Lines(Text text, bool joins = false) : text_(text), joins_(joins) {}

    bool next(Text& line) {
        if (text_.empty()) return false;
        std::size_t end = 0;
        for (;; ++end) {
            while (end < text_.size() && !isEnd(text_[end])) ++end;
            if (!joins_ || end == 0 || end == text_.size() || text_[end - 1] != '\\') break;
            end += startsWith(text_.substr(end), "\r\n");
        }
        line = text_.substr(0, end);
        text_.remove_prefix(std::min(text_.size(), end + (startsWith(text_.substr(end), "\r\n") ? 2 : 1)));
        return true;
    }
    /// What follows the last line.
    Text rest() const { return text_; }

private:
    Text text_;
    bool joins_;
};

inline void appendUtf8(std::string& text, std::uint32_t code) {
    const int more = code < 0x80 ? 0 : code < 0x800 ? 1 : code < 0x10000 ? 2 : 3;
    text += static_cast<char>(more == 0 ? code : (0xf0 << (3 - more) & 0xff) | code >> 6 * more);
    for (int shift = 6 * (more - 1); shift >= 0; shift -= 6) text += static_cast<char>(0x80 | (code >> shift & 0x3f));
}

/// The text of a file, UTF-16 if it begins with a mark of it; of others a mark of UTF-8 is left out. `buffer` holds a
/// text that is translated.
inline Text textOf(Text bytes, std::string& buffer) {
    if (startsWith(bytes, "\xef\xbb\xbf")) return bytes.substr(3);
    const bool isBig = startsWith(bytes, "\xfe\xff");
    if (!isBig && !startsWith(bytes, "\xff\xfe")) return bytes;
    const auto unit = [&](std::size_t at) -> std::uint32_t {
        const auto one = static_cast<unsigned char>(bytes[at]), other = static_cast<unsigned char>(bytes[at + 1]);
        return isBig ? one << 8 | other : other << 8 | one;
    };
    for (std::size_t at = 2; at + 2 <= bytes.size(); at += 2) {
        std::uint32_t code = unit(at);
        const std::uint32_t next = at + 4 <= bytes.size() ? unit(at + 2) : 0;
        if (code >> 10 == 0x36 && next >> 10 == 0x37) {
            code = 0x10000 + ((code & 0x3ff) << 10 | (next & 0x3ff));
            at += 2;
        } else if (code >> 11 == 0x1b) code = 0xfffd;
        appendUtf8(buffer, code);
    }
    return buffer;
}

/// The whole number that a word is, at most 10^18 of either sign; nothing if it is none.
inline std::optional<std::int64_t> wholeOf(Text word) {
    const bool isNegative = !word.empty() && word[0] == '-';
    if (!word.empty() && (isNegative || word[0] == '+')) word.remove_prefix(1);
    if (word.empty()) return {};
    constexpr std::int64_t max = 1'000'000'000'000'000'000;
    std::int64_t value = 0;
    for (const char one : word) {
        if (!isDigit(one)) return {};
        value = std::min(10 * std::min(value, max / 10) + (one - '0'), max);
    }
    return isNegative ? -value : value;
}

namespace decimal {

using Wide = unsigned __int128;

/// The double nearest to value · 2^exponent, of which `isMore` says whether some is missing.
inline double rounded(Wide value, bool isMore, int exponent) {
    if (value == 0) return 0;
    const auto high = static_cast<std::uint64_t>(value >> 64), low = static_cast<std::uint64_t>(value);
    const int bits = high ? 128 - __builtin_clzll(high) : 64 - __builtin_clzll(low);
    const int dropped = std::max(bits + exponent - 53, -1074) - exponent;
    if (dropped <= 0) return std::ldexp(static_cast<double>(low), exponent); // of at most 53 bits
    if (dropped > 126) return 0;
    auto kept = static_cast<std::uint64_t>(value >> dropped);
    const Wide rest = value & ((Wide{1} << dropped) - 1), half = Wide{1} << (dropped - 1);
    kept += rest > half || (rest == half && (isMore || kept & 1));
    return std::ldexp(static_cast<double>(kept), dropped + exponent);
}

/// A whole number of any size.
class Big {
public:
    explicit Big(std::uint32_t value) : words_{value} {}

    void multiply(std::uint32_t by, std::uint32_t plus = 0) {
        std::uint64_t carry = plus;
        for (std::uint32_t& word : words_) {
            carry += std::uint64_t{word} * by;
            word = static_cast<std::uint32_t>(carry);
            carry >>= 32;
        }
        if (carry) words_.push_back(static_cast<std::uint32_t>(carry));
    }
    void shift(int bits) {
        words_.insert(words_.begin(), static_cast<std::size_t>(bits / 32), 0);
        multiply(std::uint32_t{1} << bits % 32);
    }
    int bits() const {
        std::size_t count = words_.size();
        while (count > 1 && words_[count - 1] == 0) --count;
        return static_cast<int>(32 * count) - (words_[count - 1] ? __builtin_clz(words_[count - 1]) : 32);
    }
    /// Subtracts a number if it is not larger.
    bool subtract(const Big& other) {
        const auto at = [](const Big& from, std::size_t i) { return i < from.words_.size() ? from.words_[i] : 0; };
        const std::size_t count = std::max(words_.size(), other.words_.size());
        for (std::size_t i = count; i-- > 0;) {
            if (at(*this, i) > at(other, i)) break;
            if (at(*this, i) < at(other, i)) return false;
        }
        std::int64_t carry = 0;
        for (std::size_t i = 0; i < words_.size(); ++i) {
            carry += std::int64_t{words_[i]} - at(other, i);
            words_[i] = static_cast<std::uint32_t>(carry);
            carry >>= 32;
        }
        return true;
    }
    bool isZero() const { return bits() == 0; }

private:
    std::vector<std::uint32_t> words_;
};

/// Digits, whose first is not 0, times 10^exponent.
inline double slow(Text digits, std::int64_t exponent) {
    // Further digits decide no rounding but by being there
    constexpr std::size_t most = 800;
    const bool isMore = digits.size() > most;
    exponent += static_cast<std::int64_t>(digits.size());
    if (exponent > 310) return std::numeric_limits<double>::infinity();
    if (exponent < -330) return 0;
    digits = digits.substr(0, most);
    exponent -= static_cast<std::int64_t>(digits.size());
    Big value(0), divisor(1);
    for (const char one : digits) value.multiply(10, static_cast<std::uint32_t>(one - '0'));
    for (std::int64_t i = 0; i < std::abs(exponent); ++i) (exponent > 0 ? value : divisor).multiply(10);
    // A quotient of 64 or 65 bits
    const int shift = 64 - (value.bits() - divisor.bits());
    (shift > 0 ? value : divisor).shift(std::abs(shift));
    divisor.shift(65);
    Wide quotient = 0;
    for (int bit = 0; bit <= 65; ++bit) {
        quotient = quotient << 1 | value.subtract(divisor);
        value.multiply(2);
    }
    return rounded(quotient, isMore || !value.isZero(), -shift);
}

inline constexpr double tens[]{1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                               1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

/// A number of at most 19 digits times 10^exponent, from -19 to 19.
inline double middle(std::uint64_t value, int exponent) {
    std::uint64_t power = 1;
    for (int i = std::abs(exponent); i > 0; --i) power *= 10;
    if (exponent >= 0) return rounded(Wide{value} * power, false, 0);
    const int shift = 64 + __builtin_clzll(value);
    const Wide whole = Wide{value} << shift;
    return rounded(whole / power, whole % power != 0, -shift);
}

} // namespace decimal

/// The number that a word is; nothing if it is none.
inline std::optional<double> numberOf(Text word) {
    const char *at = word.data(), *end = at + word.size();
    const bool isNegative = at != end && *at == '-';
    if (at != end && (isNegative || *at == '+')) ++at;
    const char* first = at;
    std::uint64_t value = 0;
    int count = 0; // digits of the value
    std::int64_t exponent = 0;
    bool hasDigits = false, isWhole = true, isPoint = false;
    for (; at != end; ++at) {
        if (*at == '.' && !isPoint) {
            isPoint = true;
            continue;
        }
        if (!isDigit(*at)) break;
        hasDigits = true;
        exponent -= isPoint;
        if (count == 19) {
            isWhole &= *at == '0';
            ++exponent;
        } else if (count > 0 || *at != '0') {
            value = 10 * value + static_cast<std::uint64_t>(*at - '0');
            ++count;
        }
    }
    const char* last = at;
    double found;
    if (!hasDigits) {
        const std::string name = lowered({first, static_cast<std::size_t>(end - first)});
        if (name != "inf" && name != "infinity" && name != "nan") return {};
        found = name == "nan" ? std::numeric_limits<double>::quiet_NaN() : std::numeric_limits<double>::infinity();
        return isNegative ? -found : found;
    }
    std::int64_t written = 0;
    if (at != end && (*at == 'e' || *at == 'E')) {
        const std::optional<std::int64_t> given = wholeOf({at + 1, static_cast<std::size_t>(end - at - 1)});
        if (!given) return {};
        exponent += written = std::clamp<std::int64_t>(*given, -1'000'000'000'000, 1'000'000'000'000);
        at = end;
    }
    if (at != end) return {};
    if (value == 0) found = 0;
    else if (isWhole && value <= std::uint64_t{1} << 53 && exponent >= -22 && exponent <= 22)
        found = exponent < 0 ? static_cast<double>(value) / decimal::tens[-exponent]
                             : static_cast<double>(value) * decimal::tens[exponent];
    else if (isWhole && std::abs(exponent) <= 19) found = decimal::middle(value, static_cast<int>(exponent));
    else {
        std::string digits;
        exponent = written;
        bool isFraction = false;
        for (const char* one = first; one != last; ++one) {
            isFraction |= *one == '.';
            if (*one == '.') continue;
            exponent -= isFraction;
            if (!digits.empty() || *one != '0') digits += *one;
        }
        found = decimal::slow(digits, exponent);
    }
    return isNegative ? -found : found;
}

/// What says that a word is no number; of a long one its beginning.
inline std::string noNumber(Text word) { return std::string(word.substr(0, 40)) + " is no number"; }

} // namespace colonnade::mesh
