#pragma once
// The name that somebody most likely meant who wrote another one: for the messages about unknown commands, options, algorithms and
// parameters.

#include <span>
#include <string>
#include <string_view>

namespace lightloom {

/// How many single-character mistakes (one too many, one missing, one wrong, two neighbours exchanged) make one word of the other;
/// capitals count as small letters. The optimal string alignment distance [Damerau 1964].
size_t spelling_mistakes(std::string_view a, std::string_view b);

/// The one of `known` that is nearest to `word`, the first of several; empty where none is near. Near is a word with at most one
/// mistake for every three characters of the longer one, and one that begins with `word` if that has three characters or more.
std::string_view nearest(std::string_view word, std::span<const std::string_view> known);

/// " (did you mean 'NAME'?)" with the nearest name; empty where none is near.
std::string did_you_mean(std::string_view word, std::span<const std::string_view> known);

}  // namespace lightloom
