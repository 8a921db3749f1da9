package colonnade.microcode

import chisel3._
import chisel3.util.log2Ceil

/** How a program's current step is stored. */
sealed trait StepEncoding

object StepEncoding {
  case object OneHot extends StepEncoding // one register per step, so a step's signals need no decoder

  /** A counter. Small, but each signal decodes it.
    *
    * @param stall repeats a step that does not jump
    */
  final case class Binary(stall: Bool = false.B) extends StepEncoding
}

/** The register that holds the current step; step 0 follows a reset. */
private[microcode] trait StepRegister {
  def isNow(step: Int): Bool

  /** One of these steps is next. */
  def isNext(steps: Seq[Int]): Bool

  /** The stall repeats the current step. */
  def isStalled: Bool

  /** Connects the next step; to be called once.
    *
    * @param jumps  by target, the conditions of all jumps to it
    * @param onward by step, the condition under which the step after it is next
    */
  def connect(jumps: Map[Int, Seq[Bool]], onward: Seq[Bool]): Unit
}

private[microcode] object StepRegister {

  /** @param names of the steps in a waveform */
  def apply(encoding: StepEncoding, names: Seq[String]): StepRegister = encoding match {
    case StepEncoding.OneHot        => new OneHotSteps(names)
    case StepEncoding.Binary(stall) => new BinarySteps(names.size, stall)
  }
}

final private class OneHotSteps(names: Seq[String]) extends StepRegister {
  private val steps = names.zipWithIndex.map { case (name, index) =>
    RegInit((index == 0).B).suggestName(s"step_$name")
  }
  private val next = names.map(name => Wire(Bool()).suggestName(s"next_$name"))

  def isNow(step: Int): Bool = steps(step)

  def isNext(indices: Seq[Int]): Bool = indices.map(next(_)).reduce(_ || _)

  def isStalled: Bool = false.B

  def connect(jumps: Map[Int, Seq[Bool]], onward: Seq[Bool]): Unit =
    for (index <- steps.indices) {
      next(index)  := (jumps.getOrElse(index, Nil) ++ onward.lift(index - 1)).reduceOption(_ || _).getOrElse(false.B)
      steps(index) := next(index)
    }
}

final private class BinarySteps(count: Int, stall: Bool) extends StepRegister {
  private val bits = log2Ceil(count)
  private val step = RegInit(0.U(bits.W)).suggestName("step")
  private val next = WireInit((step + 1.U)(bits - 1, 0)).suggestName("nextStep")

  def isNow(index: Int): Bool = step === index.U

  val isStalled: Bool = WireInit(stall).suggestName("isStalled")

  def isNext(indices: Seq[Int]): Bool = indices.map(next === _.U).reduce(_ || _)

  def connect(jumps: Map[Int, Seq[Bool]], onward: Seq[Bool]): Unit = {
    when(stall)(next := step)
    for ((target, conditions) <- jumps.toSeq.sortBy(_._1)) when(conditions.reduce(_ || _)) {
      next      := target.U
      isStalled := false.B
    }
    step := next
  }
}
