package colonnade

import org.scalatest.Reporter
import org.scalatest.events.{Event, SuiteAborted, TestFailed}

/** Ends the JVM of the tests at the first one that fails, and names it: for `tools/mutations`. */
class FirstFailure extends Reporter {
  def apply(event: Event): Unit = event match {
    case test: TestFailed    => end(test.testName, test.message)
    case suite: SuiteAborted => end("before the tests", suite.message)
    case _                   => ()
  }

  private def end(test: String, message: String): Unit = {
    println(s"FIRST FAILURE: $test: ${message.linesIterator.nextOption().getOrElse("")}")
    Console.flush()
    Runtime.getRuntime.halt(FirstFailure.status)
  }
}

object FirstFailure {
  val status = 3
}
