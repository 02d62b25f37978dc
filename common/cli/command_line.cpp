#include "common/cli/command_line.h"

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/cli/help.h"

namespace lightloom::cli {

Option Option::required() const {
    option_->required();
    return *this;
}
Option Option::check(const Check& wanted) const {
    option_->check(wanted.find_fault, wanted.range);
    return *this;
}
Option Option::check(const FindFault& find_fault) const { return check({find_fault, ""}); }
Option Option::capture_default_str() const {
    option_->capture_default_str();
    return *this;
}
Option Option::needs(const Option& other) const {
    option_->needs(other.option_);
    return *this;
}
Option Option::excludes(const Option& other) const {
    option_->excludes(other.option_);
    return *this;
}
Option Option::type_name(const std::string& name) const {
    option_->type_name(name);
    return *this;
}
Option Option::expected(int count) const {
    option_->expected(count);
    return *this;
}
Option Option::expected(int least, int most) const {
    option_->expected(least, most);
    return *this;
}
Option Option::delimiter(char between) const {
    option_->delimiter(between);
    return *this;
}
Option Option::take_all() const {
    option_->take_all();
    return *this;
}
Option Option::allow_extra_args(bool allowed) const {
    option_->allow_extra_args(allowed);
    return *this;
}
Option Option::envname(const std::string& name) const {
    option_->envname(name);
    return *this;
}
Option Option::group(const std::string& name) const {
    option_->group(name);
    return *this;
}
size_t Option::count() const { return option_->count(); }
std::string Option::name() const { return option_->get_name(); }

App App::add_subcommand(const std::string& name, const std::string& description) const {
    return *app_->add_subcommand(name, description);
}
template <typename T>
Option App::add_option(const std::string& names, T& value, const std::string& description) const {
    return Option(app_->add_option(names, value, description));
}
Option App::add_flag(const std::string& names, bool& value, const std::string& description) const {
    return Option(app_->add_flag(names, value, description));
}
Option App::get_option(const std::string& name) const { return Option(app_->get_option(name)); }
void App::footer(const std::string& text) const { app_->footer(text); }
void App::callback(const std::function<void()>& run) const { app_->callback(run); }

Program::Program(const std::string& description, const std::string& name)
    : Program(std::make_shared<CLI::App>(description, name)) {}
Program::Program(std::shared_ptr<CLI::App> app) : App(*app), owned_(std::move(app)) {
    owned_->formatter(std::make_shared<HelpFormatter>());
}

void throw_required(const std::string& names) { throw CLI::RequiredError(names); }

template Option App::add_option(const std::string&, std::string&, const std::string&) const;
template Option App::add_option(const std::string&, double&, const std::string&) const;
template Option App::add_option(const std::string&, int&, const std::string&) const;
template Option App::add_option(const std::string&, uint32_t&, const std::string&) const;
template Option App::add_option(const std::string&, uint64_t&, const std::string&) const;
template Option App::add_option(const std::string&, std::optional<uint64_t>&, const std::string&) const;
template Option App::add_option(const std::string&, std::vector<std::string>&, const std::string&) const;
template Option App::add_option(const std::string&, std::vector<int>&, const std::string&) const;
template Option App::add_option(const std::string&, std::vector<uint32_t>&, const std::string&) const;

}  // namespace lightloom::cli
