/// JSON in UTF-8, which a file may have in any form: a list of its values, which refer to its text.
///
/// What is refused, and its words, are those of host/colonnade/common/input_files.py.
#pragma once

#include "mesh/files/losses.hpp"
#include "mesh/files/text.hpp"

namespace colonnade::mesh {

/// A value is followed by those in it; of an object each by its key, which is a text.
struct JsonNode {
    std::uint32_t begin, length; ///< in the text; those of a text without quotes
    std::uint32_t next;          ///< the number of what follows the value and those in it
    char type;                   ///< n(ull), t(rue), f(alse), i(nteger), r(eal), ", [ or {
};

class Json;

/// A value of a document, or none.
class JsonValue {
public:
    JsonValue() = default;
    JsonValue(const Json* json, std::size_t at) : json_(json), at_(at) {}

    explicit operator bool() const { return json_ != nullptr; }
    char type() const { return json_ ? node().type : '\0'; }
    bool isObject() const { return type() == '{'; }
    bool isList() const { return type() == '['; }
    bool isText() const { return type() == '"'; }
    bool isNumber() const { return type() == 'i' || type() == 'r'; }
    /// Whether it is a whole number from 0 on that a double holds.
    bool isWhole() const { return type() == 'i' && number() >= 0 && number() < 0x1p53; }
    double number() const { return numberOf(raw()).value_or(0); }
    /// The text of a value, of none nothing.
    Text raw() const;
    /// The characters of a text.
    std::string text() const;
    bool isText(Text other) const {
        return isText() && (raw().find('\\') == Text::npos ? raw() == other : text() == other);
    }
    /// The whole number of an entry, or one that stands for it.
    double wholeOf(Text key, double otherwise = 0) const {
        const JsonValue found = (*this)[key];
        return found ? found.number() : otherwise;
    }
    /// The entry of an object; none if it is no object.
    JsonValue operator[](Text key) const {
        JsonValue found;
        if (isObject())
            each([&](JsonValue own, JsonValue value) {
                if (!found && own.isText(key)) found = value;
                return !found;
            });
        return found;
    }
    /// Calls `use` with each key, none in a list, and value, while it is true; whether it always was, as in no value.
    template <class Use> bool each(const Use& use) const;

private:
    const JsonNode& node() const;

    const Json* json_ = nullptr;
    std::size_t at_ = 0;
};

class Json {
public:
    /// Reads a text, which stays; an error, after what it is of, or none.
    std::string read(Text bytes) {
        nodes.clear();
        error_.clear();
        text = bytes;
        at_ = 0;
        if (!isUtf8()) return error_;
        if (startsWith(text, mark)) text.remove_prefix(mark.size());
        constexpr std::int64_t most = 1 << 20;
        const auto groups = std::count_if(text.begin(), text.end(), [](char one) { return one == '[' || one == '{'; });
        if (groups > most) return is("it holds more than 1,048,576 lists and objects"), error_;
        if (startsWith(text, mark)) fail("Unexpected UTF-8 BOM (decode using utf-8-sig)", 0);
        else if (skip(), value(0)) {
            skip();
            if (at_ < text.size()) fail("Extra data", at_);
        }
        return error_;
    }
    JsonValue root() const { return {this, 0}; }

    Text text;
    std::vector<JsonNode> nodes;

private:
    static constexpr Text mark = "\xef\xbb\xbf";
    static constexpr int maxDepth = 64, maxDigits = 40;

    bool is(const std::string& reason) {
        error_ = " is not JSON: " + reason;
        return false;
    }
    /// Says where an error is, by characters.
    bool fail(const char* reason, std::size_t position) {
        std::size_t line = 1, column = 1, character = 0;
        for (std::size_t i = 0; i < position; ++i) {
            const bool isNew = (text[i] & 0xc0) != 0x80;
            character += isNew;
            column += isNew;
            if (text[i] == '\n') {
                ++line;
                column = 1;
            }
        }
        return is(reason + (": line " + std::to_string(line)) + " column " + std::to_string(column) + " (char " +
                  std::to_string(character) + ")");
    }
    bool isUtf8() {
        for (std::size_t i = 0; i < text.size();) {
            const auto at = [&](std::size_t position) { return static_cast<unsigned char>(text[position]); };
            const int first = at(i++);
            if (first < 0x80) continue;
            if (first < 0xc2 || first > 0xf4) return is("it is not UTF-8 text (invalid start byte)");
            int low = first == 0xe0 ? 0xa0 : first == 0xf0 ? 0x90 : 0x80;
            int high = first == 0xed ? 0x9f : first == 0xf4 ? 0x8f : 0xbf;
            for (int more = first < 0xe0 ? 1 : first < 0xf0 ? 2 : 3; more > 0; --more, ++i, low = 0x80, high = 0xbf) {
                if (i == text.size()) return is("it is not UTF-8 text (unexpected end of data)");
                if (at(i) < low || at(i) > high) return is("it is not UTF-8 text (invalid continuation byte)");
            }
        }
        return true;
    }

    char peek() const { return at_ < text.size() ? text[at_] : '\0'; }
    void skip() {
        while (at_ < text.size() && Text(" \t\n\r").find(text[at_]) != Text::npos) ++at_;
    }
    std::size_t open(char type, std::size_t begin) {
        nodes.push_back({static_cast<std::uint32_t>(begin), 0, 0, type});
        return nodes.size() - 1;
    }
    void close(std::size_t node, std::size_t end) {
        nodes[node].length = static_cast<std::uint32_t>(end) - nodes[node].begin;
        nodes[node].next = static_cast<std::uint32_t>(nodes.size());
    }
    bool value(int depth) {
        if (at_ == text.size()) return fail("Expecting value", at_);
        if (depth > maxDepth) {
            error_ = " is nested too deeply: 64 levels at most";
            return false;
        }
        const char first = peek();
        if (first == '"') return string();
        if (first == '{' || first == '[') return group(depth);
        for (const Text word : {"null", "true", "false"})
            if (startsWith(text.substr(at_), word)) {
                const std::size_t node = open(first, at_);
                at_ += word.size();
                close(node, at_);
                return true;
            }
        for (const Text word : {"NaN", "Infinity", "-Infinity"})
            if (startsWith(text.substr(at_), word)) return is(std::string(word) + " is not a JSON number");
        return number();
    }
    bool number() {
        const std::size_t begin = at_;
        const auto digits = [&](std::size_t from) {
            while (from < text.size() && isDigit(text[from])) ++from;
            return from;
        };
        std::size_t end = begin + (peek() == '-');
        if (end == text.size() || !isDigit(text[end])) return fail("Expecting value", begin);
        end = text[end] == '0' ? end + 1 : digits(end);
        bool isReal = false;
        if (end < text.size() && text[end] == '.' && digits(end + 1) > end + 1) {
            isReal = true;
            end = digits(end + 1);
        }
        if (end < text.size() && (text[end] == 'e' || text[end] == 'E')) {
            const bool isSigned = end + 1 < text.size() && (text[end + 1] == '-' || text[end + 1] == '+');
            const std::size_t power = end + 1 + isSigned;
            if (digits(power) > power) {
                isReal = true;
                end = digits(power);
            }
        }
        const Text own = text.substr(begin, end - begin);
        if (!isReal && own.size() > maxDigits)
            return is("a number has " + grouped(own.size()) + " digits, " + std::to_string(maxDigits) + " at most");
        if (isReal && !std::isfinite(*numberOf(own))) return is("the number " + std::string(own) + " is too large");
        at_ = end;
        close(open(isReal ? 'r' : 'i', begin), end);
        return true;
    }
    bool string() {
        const std::size_t begin = at_, node = open('"', ++at_);
        for (;; ++at_) {
            if (at_ == text.size()) return fail("Unterminated string starting at", begin);
            if (peek() == '"') break;
            if (static_cast<unsigned char>(peek()) < 0x20) return fail("Invalid control character at", at_);
            if (peek() != '\\') continue;
            if (++at_ == text.size()) return fail("Unterminated string starting at", begin);
            if (peek() != 'u') {
                if (Text("\"\\/bfnrt").find(peek()) == Text::npos) return fail("Invalid \\escape", at_ - 1);
                continue;
            }
            for (std::size_t i = 1; i <= 4; ++i)
                if (at_ + 5 >= text.size() || digitOf(text[at_ + i]) < 0) return fail("Invalid \\uXXXX escape", at_);
            at_ += 4;
        }
        close(node, at_++);
        return true;
    }
    bool group(int depth) {
        const bool isObject = peek() == '{';
        const std::size_t node = open(peek(), at_);
        ++at_;
        const char end = isObject ? '}' : ']';
        skip();
        while (peek() != end) {
            if (isObject) {
                if (peek() != '"') return fail("Expecting property name enclosed in double quotes", at_);
                if (!string()) return false;
                skip();
                if (peek() != ':') return fail("Expecting ':' delimiter", at_);
                ++at_;
                skip();
            }
            if (!value(depth + 1)) return false;
            skip();
            if (peek() == end) break;
            if (peek() != ',') return fail("Expecting ',' delimiter", at_);
            ++at_;
            skip();
            if (peek() == end)
                return fail(isObject ? "Expecting property name enclosed in double quotes" : "Expecting value", at_);
        }
        close(node, ++at_);
        return !isObject || hasOwnKeys(node);
    }
    /// Refuses the first key of an object that occurs again.
    bool hasOwnKeys(std::size_t node) {
        std::vector<std::pair<std::string, std::size_t>> keys;
        const JsonValue object(this, node);
        object.each([&](JsonValue key, JsonValue) {
            keys.emplace_back(key.text(), keys.size());
            return true;
        });
        std::sort(keys.begin(), keys.end());
        std::size_t first = keys.size();
        std::string twice;
        for (std::size_t i = 1; i < keys.size(); ++i)
            if (keys[i].first == keys[i - 1].first && keys[i].second < first) {
                first = keys[i].second;
                twice = keys[i].first;
            }
        return first == keys.size() || is("the key " + twice + " occurs twice in an object");
    }

public:
    /// The value of a hexadecimal digit; -1 for no digit.
    static int digitOf(char one) {
        return isDigit(one) ? one - '0' : lower(one) >= 'a' && lower(one) <= 'f' ? lower(one) - 'a' + 10 : -1;
    }

private:
    std::string error_;
    std::size_t at_ = 0;
};

inline const JsonNode& JsonValue::node() const { return json_->nodes[at_]; }
inline Text JsonValue::raw() const { return json_ ? json_->text.substr(node().begin, node().length) : Text(); }

template <class Use> bool JsonValue::each(const Use& use) const {
    if (!json_) return true;
    const std::size_t end = node().next;
    for (std::size_t at = at_ + 1; at < end;) {
        JsonValue key;
        if (isObject()) key = JsonValue(json_, at++);
        if (!use(key, JsonValue(json_, at))) return false;
        at = json_->nodes[at].next;
    }
    return true;
}

inline std::string JsonValue::text() const {
    std::string found;
    const Text from = raw();
    const auto code = [&](std::size_t at) {
        std::uint32_t value = 0;
        for (std::size_t i = 0; i < 4; ++i)
            value = 16 * value + static_cast<std::uint32_t>(Json::digitOf(from[at + i]));
        return value;
    };
    for (std::size_t i = 0; i < from.size(); ++i) {
        if (from[i] != '\\') {
            found += from[i];
            continue;
        }
        const char one = from[++i];
        if (one != 'u') {
            const std::size_t which = Text("bfnrt").find(one);
            found += which == Text::npos ? one : "\b\f\n\r\t"[which];
            continue;
        }
        std::uint32_t value = code(i + 1);
        i += 4;
        const bool isPair = value >> 10 == 0x36 && i + 6 < from.size() && startsWith(from.substr(i + 1), "\\u");
        if (isPair && code(i + 3) >> 10 == 0x37) {
            value = 0x10000 + ((value & 0x3ff) << 10 | (code(i + 3) & 0x3ff));
            i += 6;
        }
        appendUtf8(found, value);
    }
    return found;
}

} // namespace colonnade::mesh
