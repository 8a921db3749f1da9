package colonnade.environment

import chisel3._
import chiseltest._
import circt.stage.ChiselStage
import org.scalatest.flatspec.AnyFlatSpec

/** Shows the operand that each step chooses: 1 waits for `go`, 2 and 3 follow, 3 goes back to 2 while `again`; then two
  * chains overlap: 10, 11, 12 from their first step on, 21 and 22 one step later.
  */
private class ProgramHarness extends Module {
  val go    = IO(Input(Bool()))
  val again = IO(Input(Bool()))
  val first = IO(Output(UInt(8.W)))

  /** Of the second chain. */
  val second = IO(Output(UInt(8.W)))

  private val program     = new Microprogram
  private val left, right = new Operand(program, 8)

  program.step("begin") {
    left.choose(1.S)
    program.await(go)
  }
  program.step("middle")(left.choose(2.S))
  program.step {
    left.choose(3.S)
    program.branch(again -> "middle")
  }
  program.overlap { at =>
    for (cycle <- 0 to 2) at(cycle)(left.choose((10 + cycle).S))
    for (cycle <- 1 to 2) at(cycle)(right.choose((20 + cycle).S))
    at(2)(program.goto("begin"))
  }
  program.build()
  first  := left.value.asUInt
  second := right.value.asUInt
}

class MicroprogramSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "Microprogram"

  it should "wait, go on, jump, and do what overlaps side by side" in
    test(new ProgramHarness) { program =>
      def expect(first: Int, second: Int = 0, go: Boolean = false, again: Boolean = false): Unit = {
        program.go.poke(go)
        program.again.poke(again)
        program.first.expect(first, "the first chain's operand")
        program.second.expect(second, "the second chain's operand")
        program.clock.step()
      }
      expect(1)
      expect(1)
      expect(1, go = true)
      expect(2)
      expect(3, again = true)
      expect(2, go = true)
      expect(3)
      expect(10)
      expect(11, 21, again = true)
      expect(12, 22)
      expect(1)
    }

  private def refuse(message: String)(describe: (Microprogram, Operand) => Unit): Unit = {
    val error = intercept[Exception](ChiselStage.emitCHIRRTL(new Module {
      private val program = new Microprogram
      private val operand = new Operand(program, 8)
      describe(program, operand)
      program.build()
      private val out = IO(Output(SInt(8.W)))
      out := operand.value
    }))
    val messages = Iterator.iterate[Throwable](error)(_.getCause).takeWhile(_ != null).map(_.getMessage).toSeq
    assert(messages.exists(_.contains(message)), messages)
  }

  it should "not let a step choose two operands of one unit" in refuse("two operands in step 0") { (program, operand) =>
    program.overlap { at =>
      at(0)(operand.choose(1.S))
      at(0)(operand.choose(2.S))
    }
  }

  it should "not let a step branch twice" in refuse("two branches in step 1") { (program, operand) =>
    program.step("begin")(operand.choose(1.S))
    program.overlap { at =>
      at(0)(program.await(true.B))
      at(0)(program.goto("begin"))
    }
  }

  it should "not jump to where there is no step" in refuse("nowhere") { (program, operand) =>
    program.step {
      operand.choose(1.S)
      program.goto("nowhere")
    }
  }
}
