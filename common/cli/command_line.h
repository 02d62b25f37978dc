#pragma once
// Options and commands as files of commands declare them. These handles stand before CLI11, whose header alone takes a compiler
// longer than most of our files: they keep its names and meanings, and only common/cli and the client's main file include it.

#include <functional>
#include <memory>
#include <string>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace lightloom::cli {

/// What is wrong with the text of an option; empty if nothing is.
using FindFault = std::function<std::string(const std::string&)>;

/// A check of an option's text.
struct Check {
    FindFault find_fault;
    std::string range;  ///< What is allowed, as help shows it; may be empty.
};

/// An option that was declared. A handle: copies are the same option, which lives as long as its program. Its functions return it,
/// so that they can follow one another; -> stands for . as with CLI11's pointers.
class Option {
  public:
    explicit Option(CLI::Option* option) : option_(option) {}
    const Option* operator->() const { return this; }

    Option required() const;
    Option check(const Check& wanted) const;
    Option check(const FindFault& find_fault) const;
    Option capture_default_str() const;  ///< Help shows the variable's present value.
    Option needs(const Option& other) const;
    Option excludes(const Option& other) const;
    Option type_name(const std::string& name) const;
    Option expected(int count) const;
    Option expected(int least, int most) const;
    Option delimiter(char between) const;
    Option take_all() const;
    Option allow_extra_args(bool allowed) const;
    Option envname(const std::string& name) const;
    Option group(const std::string& name) const;  ///< "": help does not show it.
    size_t count() const;                         ///< How often it was given.
    std::string name() const;                     ///< "--budget", for messages.

  private:
    CLI::Option* option_;
};

/// A program or one of its commands, a handle as well.
class App {
  public:
    /// Every function that takes a handle takes CLI11's object, and the other way round.
    App(CLI::App& app) : app_(&app) {}
    operator CLI::App&() const { return *app_; }
    const App* operator->() const { return this; }
    const App& operator*() const { return *this; }

    App add_subcommand(const std::string& name, const std::string& description) const;
    /// For the types of values that command_line.cpp lists.
    template <typename T>
    Option add_option(const std::string& names, T& value, const std::string& description) const;
    Option add_flag(const std::string& names, bool& value, const std::string& description) const;
    Option get_option(const std::string& name) const;
    void footer(const std::string& text) const;
    void callback(const std::function<void()>& run) const;

  private:
    CLI::App* app_;
};

/// A program's command line. The variables of its options outlive it.
class Program : public App {
  public:
    Program(const std::string& description, const std::string& name);

  private:
    explicit Program(std::shared_ptr<CLI::App> app);
    std::shared_ptr<CLI::App> owned_;
};

/// To be thrown in a command's callback where one of several options must be given: `names`.
[[noreturn]] void throw_required(const std::string& names);

}  // namespace lightloom::cli
