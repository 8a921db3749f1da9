package colonnade.microcode

import chisel3._
import chiseltest._
import circt.stage.ChiselStage
import org.scalatest.flatspec.AnyFlatSpec

sealed private trait TestLabel extends Label

private object TestLabel {
  case object Begin   extends TestLabel
  case object Middle  extends TestLabel
  case object Nowhere extends TestLabel
}

private case object ForeignLabel extends Label

/** Outputs the operand and signals of each step. Step 1 waits for `go`, steps 2 and 3 follow, step 3 jumps back to 2
  * while `again`. Then two chains overlap: 10, 11, 12, and from the second cycle on 21, 22.
  */
private class ProgramHarness(encoding: => StepEncoding) extends Module {
  import TestLabel._

  val go    = IO(Input(Bool()))
  val again = IO(Input(Bool()))
  val first = IO(Output(UInt(8.W)))

  /** Of the second chain. */
  val second = IO(Output(UInt(8.W)))

  /** Raised in steps 2 and 3, in step 3 only while `again`. */
  val signal = IO(Output(Bool()))

  /** Raised in step 3. */
  val early   = IO(Output(Bool()))
  val isBegin = IO(Output(Bool()))

  val program             = new Microprogram[TestLabel](encoding)
  private val left, right = new Operand(program, 8)

  program.step(Begin) {
    left.choose(1.S)
    program.await(go, "go")
  }
  program.step(Middle) {
    left.choose(2.S)
    program.raise(signal)
  }
  program.step {
    left.choose(3.S)
    program.raise(signal, again)
    program.raiseEarly(early)
    program.branch(Middle.when(again, "again"))
  }
  program.overlap { at =>
    for (cycle <- 0 to 2) at(cycle)(left.choose((10 + cycle).S))
    for (cycle <- 1 to 2) at(cycle)(right.choose((20 + cycle).S))
    at(2)(program.goto(Begin))
  }
  isBegin := program.isAt(Begin)
  program.build()
  first  := left.value.asUInt
  second := right.value.asUInt
}

class MicroprogramSpec extends AnyFlatSpec with ChiselScalatestTester {
  import TestLabel._

  behavior of "Microprogram"

  for ((name, encoding) <- Seq("one-hot" -> (() => StepEncoding.OneHot), "binary" -> (() => StepEncoding.Binary())))
    it should s"wait, go on, jump, and overlap operations, in $name encoding" in
      test(new ProgramHarness(encoding())) { program =>
        def expect(
            first:  Int,
            second: Int = 0,
            go:     Boolean = false,
            again:  Boolean = false,
            signal: Boolean = false
        ): Unit = {
          program.go.poke(go)
          program.again.poke(again)
          program.first.expect(first, "the first chain's operand")
          program.second.expect(second, "the second chain's operand")
          program.signal.expect(signal, "a signal")
          program.early.expect(first == 3, "a signal with a register of its own")
          program.isBegin.expect(first == 1, "a label's step")
          program.clock.step()
        }
        expect(1)
        expect(1)
        expect(1, go = true)
        expect(2, signal = true)
        expect(3, again = true, signal = true)
        expect(2, go = true, signal = true)
        expect(3)
        expect(10)
        expect(11, 21, again = true)
        expect(12, 22)
        expect(1)
      }

  it should "repeat a step while it stalls, unless the step jumps" in
    test(new Module {
      val stall     = IO(Input(Bool()))
      val jump      = IO(Input(Bool()))
      val isBegin   = IO(Output(Bool()))
      val isMiddle  = IO(Output(Bool()))
      val isStalled = IO(Output(Bool()))

      private val program = new Microprogram[TestLabel](StepEncoding.Binary(stall))
      program.step(Begin)(())
      program.step(Middle)(program.branch(Begin.when(jump, "jump"), Repeat.until(false.B, "nothing")))
      isBegin  := program.isAt(Begin)
      isMiddle := program.isAt(Middle)
      program.build()
      isStalled := program.isStalled
    }) { dut =>
      def expect(isBegin: Boolean, stall: Boolean, jump: Boolean, isStalled: Boolean): Unit = {
        dut.stall.poke(stall)
        dut.jump.poke(jump)
        dut.isBegin.expect(isBegin)
        dut.isMiddle.expect(!isBegin)
        dut.isStalled.expect(isStalled)
        dut.clock.step()
      }
      expect(isBegin = true, stall = true, jump = false, isStalled = true)
      expect(isBegin = true, stall = false, jump = true, isStalled = false)
      expect(isBegin = false, stall = false, jump = false, isStalled = false)
      expect(isBegin = false, stall = true, jump = true, isStalled = false)
      expect(isBegin = true, stall = false, jump = false, isStalled = false)
    }

  it should "draw its states" in {
    var harness = Option.empty[ProgramHarness]
    ChiselStage.emitCHIRRTL {
      harness = Some(new ProgramHarness(StepEncoding.OneHot))
      harness.get
    }
    val lines = harness.get.program.graph("test").linesIterator.map(_.trim).toSeq
    assert(lines.contains("""Begin [label="Begin\n1 step\nuntil go"];"""))
    assert(lines.contains("""Middle [label="Middle\n5 steps"];"""))
    assert(lines.filter(_.contains("->")) == Seq(
      "Begin -> Middle;",
      """Middle -> Middle [label="again"];""",
      """Middle -> Begin [label="otherwise"];"""
    ))
  }

  it should "not compile a jump to a label of another program" in {
    val program = new Microprogram[TestLabel](StepEncoding.OneHot)
    assertCompiles("program.goto(TestLabel.Begin)")
    assertDoesNotCompile("program.goto(ForeignLabel)")
    assertDoesNotCompile("program.goto(\"Begin\")")
    assert(program.hashCode != 0 && ForeignLabel.toString == "ForeignLabel")
  }

  private def refuse(message: String)(describe: (Microprogram[TestLabel], Operand) => Unit): Unit = {
    val error = intercept[Exception](ChiselStage.emitCHIRRTL(new Module {
      private val program = new Microprogram[TestLabel](StepEncoding.OneHot)
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
    program.label(Begin)
    program.overlap { at =>
      at(0)(operand.choose(1.S))
      at(0)(operand.choose(2.S))
    }
  }

  for (
    (how, raise) <- Seq[(String, (Microprogram[TestLabel], Bool) => Unit)](
      "raise two signals that exclude each other"       -> (_.raise(_)),
      "raise two signals early that exclude each other" -> (_.raiseEarly(_))
    )
  )
    it should s"not let a step $how" in refuse("two operations of the adder in step 0") { (program, operand) =>
      val signals = Seq.fill(2)(Wire(Bool()))
      program.exclusive("adder", signals)
      program.step(Begin) {
        signals.foreach(raise(program, _))
        operand.choose(1.S)
        program.goto(Begin)
      }
    }

  it should "not let a step branch twice" in refuse("two branches in step 1") { (program, operand) =>
    program.step(Begin)(operand.choose(1.S))
    program.overlap { at =>
      at(0)(program.await(true.B, "nothing"))
      at(0)(program.goto(Begin))
    }
  }

  it should "not jump to a label without a step" in refuse("no step Nowhere") { (program, operand) =>
    program.step(Begin) {
      operand.choose(1.S)
      program.goto(Nowhere)
    }
  }

  it should "not run off its end" in refuse("the last step goes on") { (program, operand) =>
    program.step(Begin)(operand.choose(1.S))
  }
}
