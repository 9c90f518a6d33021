// Loads a part program, waits for the verdict of the planner, runs it to its end and confirms
// tool changes. Ctrl-C cancels the run.
//
//   ros2 run rclcpp_commander commander part.ngc --ros-args -r __ns:=/mill

#include <chrono>
#include <csignal>
#include <functional>
#include <future>
#include <memory>
#include <stdexcept>
#include <string>

#include "cnc_msgs/action/run_program.hpp"
#include "cnc_msgs/msg/compensation_report.hpp"
#include "cnc_msgs/msg/machine_state.hpp"
#include "cnc_msgs/srv/load_program.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp_action/rclcpp_action.hpp"
#include "std_msgs/msg/header.hpp"
#include "std_srvs/srv/trigger.hpp"

using namespace std::chrono_literals;
using cnc_msgs::action::RunProgram;
using cnc_msgs::msg::CompensationReport;
using cnc_msgs::msg::MachineState;
using cnc_msgs::srv::LoadProgram;
using std_msgs::msg::Header;
using std_srvs::srv::Trigger;

namespace
{
volatile std::sig_atomic_t is_interrupted = 0;

// A node said no; the text is its reason.
struct Refused : std::runtime_error
{
  using std::runtime_error::runtime_error;
};

class Commander : public rclcpp::Node
{
public:
  Commander()
  : Node("commander")
  {
    // The newest value, also for those who come late.
    const auto latched = rclcpp::QoS(1).reliable().transient_local();
    states_ = create_subscription<MachineState>(
      "machine_state", latched, [this](const MachineState & state) {state_ = state;});
    reports_ = create_subscription<CompensationReport>(
      "compensation_report", latched, [this](const CompensationReport & report) {report_ = report;});
    loading_ = create_client<LoadProgram>("load_program");
    confirming_ = create_client<Trigger>("confirm_tool_change");
    runs_ = rclcpp_action::create_client<RunProgram>(this, "run_program");
    // While these come, the driver holds the machine when they stop.
    heartbeat_ = create_publisher<Header>("commander_heartbeat", 10);
    timer_ = create_wall_timer(
      250ms, [this] {
        Header now;
        now.stamp = get_clock()->now();
        heartbeat_->publish(now);
      });
    executor_.add_node(get_node_base_interface());
  }

  std::string load(const std::string & path)
  {
    auto request = std::make_shared<LoadProgram::Request>();
    request->path = path;
    const auto loaded = call<LoadProgram>(*loading_, request);
    wait_until([&] {return report_.program_id == loaded->program_id;});
    for (const auto & finding : report_.findings) {
      RCLCPP_WARN(get_logger(), "line %u: %s", finding.line, finding.message.c_str());
    }
    if (!report_.accepted) {
      throw Refused(std::to_string(report_.error_count) + " errors in the plan");
    }
    return loaded->program_id;
  }

  void run(const std::string & program_id)
  {
    if (!runs_->wait_for_action_server(10s)) {
      throw Refused("nobody offers run_program");
    }
    RunProgram::Goal goal;
    goal.program_id = program_id;
    rclcpp_action::Client<RunProgram>::SendGoalOptions options;
    options.feedback_callback =
      [this](auto, const std::shared_ptr<const RunProgram::Feedback> feedback) {
        RCLCPP_INFO(
          get_logger(), "line %u, %.0f %%, %d s left", feedback->line,
          100.0 * feedback->fraction, feedback->time_left.sec);
      };
    const auto handle = wait_for(runs_->async_send_goal(goal, options));
    if (!handle) {
      throw Refused("the goal was rejected; a warning on /rosout says why");
    }
    auto ended = runs_->async_get_result(handle);
    bool is_canceled = false;
    while (!is_ready(ended)) {
      executor_.spin_once(100ms);
      if (is_interrupted && !is_canceled) {
        is_canceled = true;
        runs_->async_cancel_goal(handle);
      } else if (!is_canceled && state_.state == MachineState::STATE_TOOL_CHANGE) {
        change_tool();
      }
    }
    const auto answer = ended.get();
    if (answer.code != rclcpp_action::ResultCode::SUCCEEDED) {
      throw Refused(
              answer.result->message + " (code " + std::to_string(answer.result->error_code) +
              ", line " + std::to_string(answer.result->last_line) + ")");
    }
  }

private:
  void change_tool()
  {
    // Your robot goes here: an action of its own, a service, a person.
    RCLCPP_INFO(get_logger(), "the robot puts T%u in", state_.tool_wanted);
    call<Trigger>(*confirming_, std::make_shared<Trigger::Request>());
    wait_until([this] {return state_.state != MachineState::STATE_TOOL_CHANGE;});
  }

  // Asks a service; a refusal is an exception with its reason.
  template<typename Service>
  typename Service::Response::SharedPtr call(
    rclcpp::Client<Service> & client, typename Service::Request::SharedPtr request)
  {
    if (!client.wait_for_service(10s)) {
      throw Refused(std::string("nobody offers ") + client.get_service_name());
    }
    auto answer = wait_for(client.async_send_request(request).future.share());
    if (!answer->success) {
      throw Refused(answer->message);
    }
    return answer;
  }

  template<typename Value>
  static bool is_ready(const std::shared_future<Value> & future)
  {
    return future.wait_for(0s) == std::future_status::ready;
  }

  template<typename Value>
  Value wait_for(const std::shared_future<Value> & future)
  {
    wait_until([&] {return is_ready(future);});
    return future.get();
  }

  void wait_until(const std::function<bool()> & condition)
  {
    while (!condition()) {
      if (!rclcpp::ok()) {
        throw Refused("the node was shut down");
      }
      executor_.spin_once(100ms);
    }
  }

  MachineState state_;
  CompensationReport report_;
  rclcpp::Subscription<MachineState>::SharedPtr states_;
  rclcpp::Subscription<CompensationReport>::SharedPtr reports_;
  rclcpp::Client<LoadProgram>::SharedPtr loading_;
  rclcpp::Client<Trigger>::SharedPtr confirming_;
  rclcpp_action::Client<RunProgram>::SharedPtr runs_;
  rclcpp::Publisher<Header>::SharedPtr heartbeat_;
  rclcpp::TimerBase::SharedPtr timer_;
  rclcpp::executors::SingleThreadedExecutor executor_;
};
}  // namespace

int main(int argc, char ** argv)
{
  // Ctrl-C does not end ROS: a run can still be canceled then.
  rclcpp::init(argc, argv, rclcpp::InitOptions(), rclcpp::SignalHandlerOptions::None);
  std::signal(SIGINT, [](int) {is_interrupted = 1;});
  const auto words = rclcpp::remove_ros_arguments(argc, argv);
  const auto commander = std::make_shared<Commander>();
  int status = 0;
  try {
    if (words.size() != 2) {
      throw Refused("usage: commander PROGRAM");
    }
    commander->run(commander->load(words[1]));
    RCLCPP_INFO(commander->get_logger(), "the part is done");
  } catch (const Refused & refused) {
    RCLCPP_ERROR(commander->get_logger(), "%s", refused.what());
    status = 1;
  }
  rclcpp::shutdown();
  return status;
}
