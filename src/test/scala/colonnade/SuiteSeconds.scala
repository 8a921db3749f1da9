package colonnade

import org.scalatest.Reporter
import org.scalatest.events.{Event, SuiteCompleted, SuiteStarting}

import java.nio.file.{Files, Paths}

/** Prints the CPU seconds of each suite of a run one after the other, with those of programs that it ran: for
  * `tools/mutations --seconds`. Needs Linux.
  */
class SuiteSeconds extends Reporter {
  private var start = 0.0

  def apply(event: Event): Unit = event match {
    case _: SuiteStarting      => start = SuiteSeconds.used()
    case suite: SuiteCompleted => println(f"SUITE ${suite.suiteId} ${SuiteSeconds.used() - start}%.1f")
    case _                     => ()
  }
}

object SuiteSeconds {

  /** CPU seconds of this process and of its children that have ended; the kernel counts hundredths. */
  def used(): Double = {
    val fields = Files.readString(Paths.get("/proc/self/stat")).split(raw"\) ").last.split(' ')
    fields.slice(11, 15).map(_.toDouble).sum / 100
  }
}
