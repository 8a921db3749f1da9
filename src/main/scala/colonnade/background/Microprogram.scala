package colonnade.background

import chisel3._
import chisel3.util.{log2Ceil, Mux1H}

import scala.collection.mutable

/** A program of steps that follow each other, one a cycle unless a step jumps. Steps are described one after the other
  * and become hardware in [[build]], within the module that calls it.
  */
final class Microprogram {
  private val bodies = mutable.ArrayBuffer.empty[() => Unit]
  private val labels = mutable.Map.empty[String, Int]
  private val jumps  = mutable.ArrayBuffer.empty[(Bool, String)]
  private var active = Option.empty[Bool]
  private var number = 0

  /** The step that is active, while [[build]] describes it. */
  def now: Bool = active.getOrElse(throw new IllegalStateException("outside of a step"))

  /** Writes a register in the step that is active. */
  def set[T <: Data](register: T, value: T, condition: Bool = true.B): Unit =
    when(now && condition)(register := value)

  /** Names the next step. */
  def label(name: String): Unit = {
    require(!labels.contains(name), s"two steps '$name'")
    labels(name) = bodies.size
  }

  def step(body: => Unit): Unit = bodies += (() => body)

  def step(name: String)(body: => Unit): Unit = {
    label(name)
    step(body)
  }

  /** The first of these whose condition holds; if none does, the program goes on. At most once in a step. */
  def branch(cases: (Bool, String)*): Unit =
    cases.foldLeft(now) { case (left, (condition, target)) =>
      jumps += (left && condition) -> target
      left && !condition
    }

  def goto(target: String): Unit = branch(true.B -> target)

  /** Repeats this step until something is there. */
  def await(isThere: Bool): Unit = awaitOr(isThere)

  /** Jumps, or repeats this step. */
  def awaitOr(isThere: Bool, cases: (Bool, String)*): Unit = {
    val self = s"step $number"
    labels(self) = number
    branch(cases :+ (!isThere -> self): _*)
  }

  /** Makes the steps; the first one is the one after a reset. */
  def build(): Unit = {
    val state = RegInit(0.U(log2Ceil(bodies.size).W))
    for ((body, index) <- bodies.zipWithIndex) {
      val isNow = WireInit(state === index.U).suggestName(s"isStep$index")
      active = Some(isNow)
      number = index
      body()
    }
    active = None
    val targets = jumps.groupBy(_._2).toSeq.sortBy(_._1).map { case (name, from) =>
      val index = labels.getOrElse(name, throw new NoSuchElementException(name))
      from.map(_._1).reduce(_ || _) -> index.U(state.getWidth.W)
    }
    state := Mux(targets.map(_._1).reduce(_ || _), Mux1H(targets), state + 1.U)
  }
}

/** An operand that different steps choose. */
final class Operand(program: Microprogram, width: Int) {
  private val choices = mutable.ArrayBuffer.empty[(Bool, SInt)]

  def choose(value: SInt): Unit = choices += program.now -> value

  /** A step chooses. */
  def isChosen: Bool = choices.map(_._1).reduce(_ || _)

  /** What the step that is active chooses: each value once, for all of its steps. */
  def value: SInt = {
    val different = choices.map(_._2).distinct.toSeq
    Mux1H(different.map(value => choices.filter(_._2 eq value).map(_._1).reduce(_ || _) -> fit(value)))
  }

  private def fit(value: SInt): SInt =
    if (value.getWidth > width) value.asUInt(width - 1, 0).asSInt else value.pad(width)
}
