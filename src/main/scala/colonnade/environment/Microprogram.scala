package colonnade.environment

import chisel3._
import chisel3.util.Mux1H

import scala.collection.mutable

/** A program of steps that follow each other, one a cycle unless a step jumps. Steps are described one after the other
  * and become hardware in [[build]], within the module that calls it.
  */
final class Microprogram {
  private val bodies   = mutable.ArrayBuffer.empty[() => Unit]
  private val labels   = mutable.Map.empty[String, Int]
  private val jumps    = mutable.ArrayBuffer.empty[(Bool, String)]
  private var active   = Option.empty[Bool]
  private var goesOn   = Option.empty[Bool]
  private var number   = 0
  private var upcoming = Option.empty[Vec[Bool]]

  /** The step that is active, while [[build]] describes it. */
  def now: Bool = active.getOrElse(throw new IllegalStateException("outside of a step"))

  /** Its number. */
  def index: Int = number

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

  /** Steps of which several things share the units: each part in its cycle, counted from the first of these steps. */
  def overlap(describe: Overlap => Unit): Unit = {
    val parts = new Overlap
    describe(parts)
    parts.byCycle.foreach(together => step(together.foreach(part => part())))
  }

  /** The first of these whose condition holds; if none does, the program goes on. At most once in a step. */
  def branch(cases: (Bool, String)*): Unit = {
    require(goesOn eq active, s"two branches in step $number")
    goesOn = Some(cases.foldLeft(now) { case (left, (condition, target)) =>
      jumps += (left && condition) -> target
      left && !condition
    })
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

  /** Makes the steps; the first one is the one after a reset. A register for each, so that nothing waits for a decoder. */
  def build(): Unit = {
    val steps  = RegInit(VecInit(Seq.tabulate(bodies.size)(index => (index == 0).B)))
    val next   = Wire(chiselTypeOf(steps))
    val onward = for ((body, index) <- bodies.zipWithIndex.toSeq) yield {
      val isNow = WireInit(steps(index)).suggestName(s"isStep$index")
      active = Some(isNow)
      goesOn = active
      number = index
      body()
      goesOn.get
    }
    active = None
    val targets = jumps.toSeq.groupMap { case (_, name) =>
      labels.getOrElse(name, throw new NoSuchElementException(name))
    }(_._1)
    for (index <- steps.indices)
      next(index) := (targets.getOrElse(index, Nil) ++ onward.lift(index - 1)).reduceOption(_ || _).getOrElse(false.B)
    steps         := next
    upcoming = Some(next)
  }

  /** Once the steps are made: one of these is active. A register of its own. */
  def isOneOf(indices: Set[Int]): Bool = {
    val next = upcoming.getOrElse(throw new IllegalStateException("before the steps are made"))
    RegNext(indices.toSeq.sorted.map(next(_)).reduce(_ || _), indices.contains(0).B)
  }
}

/** Parts of steps that follow each other. */
final class Overlap {
  private val parts = mutable.ArrayBuffer.empty[(Int, () => Unit)]

  def apply(cycle: Int)(part: => Unit): Unit = parts += cycle -> (() => part)

  /** The parts of every cycle up to the last. */
  def byCycle: Seq[Seq[() => Unit]] =
    (0 to parts.map(_._1).max).map(cycle => parts.toSeq.collect { case (`cycle`, part) => part })
}

/** An operand that different steps choose. */
final class Operand(program: Microprogram, width: Int) {
  private val choices = mutable.LinkedHashMap.empty[SInt, Set[Int]]

  def choose(value: SInt): Unit = {
    require(
      choices.forall { case (other, steps) => (other eq value) || !steps(program.index) },
      s"two operands in step ${program.index}"
    )
    choices(value) = choices.getOrElse(value, Set.empty) + program.index
  }

  /** A step chooses. */
  lazy val isChosen: Bool = program.isOneOf(choices.values.flatten.toSet)

  /** What the step that is active chooses: each value once, for all of its steps, by a register that says so. */
  lazy val value: SInt = Mux1H(choices.toSeq.map { case (value, steps) => program.isOneOf(steps) -> fit(value) })

  private def fit(value: SInt): SInt =
    if (value.getWidth > width) value.asUInt(width - 1, 0).asSInt else value.pad(width)
}
