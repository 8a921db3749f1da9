package colonnade.microcode

import chisel3._

import scala.collection.mutable

/** A microprogram: a sequence of steps that drive a datapath, one step a cycle unless a step jumps or repeats.
  *
  * Steps are described in order and become hardware in [[build]], within the module that calls it. A step sets
  * registers, raises control signals, chooses operands, and has at most one [[branch]]. The program's [[graph]] is
  * drawn from the same description.
  *
  * {{{
  * program.step(Idle)(program.await(start, "start"))
  * program.step(Multiply)(factor.choose(digit))
  * program.step {
  *   program.raise(control.accumulate)
  *   program.branch(Multiply.when(hasDigits, "more digits"), Idle.otherwise)
  * }
  * program.build()
  * }}}
  *
  * @tparam L the program's labels
  */
final class Microprogram[L <: Label](encoding: StepEncoding) {
  private val bodies   = mutable.ArrayBuffer.empty[() => Unit]
  private val labels   = mutable.LinkedHashMap.empty[L, Int]
  private val branches = mutable.Map.empty[Int, Seq[Exit[L]]]
  private val places   = mutable.LinkedHashMap.empty[L, Bool]
  private val raised   = mutable.LinkedHashMap.empty[Bool, mutable.LinkedHashMap[Option[Bool], Set[Int]]]
  private val early    = mutable.LinkedHashMap.empty[Bool, Set[Int]]
  private val units    = mutable.ArrayBuffer.empty[(String, Seq[Bool])]
  private var active   = Option.empty[(Int, Bool)]
  private var state    = Option.empty[StepRegister]

  /** The step that [[build]] describes is the current one. */
  def now: Bool = current._2

  /** The number of the step that [[build]] describes. */
  def index: Int = current._1

  private def current: (Int, Bool) = active.getOrElse(throw new IllegalStateException("outside of a step"))

  /** Adds a step. */
  def step(body: => Unit): Unit = bodies += (() => body)

  /** Adds a step that can be jumped to. */
  def step(label: L)(body: => Unit): Unit = {
    this.label(label)
    step(body)
  }

  /** Labels the next step. */
  def label(label: L): Unit = place(label, bodies.size)

  private def place(label: L, step: Int): Unit = {
    require(!labels.contains(label), s"two steps are labelled $label")
    labels(label) = step
  }

  /** Adds steps in which several operations overlap: each part is described for its cycle, counted from the first step.
    */
  def overlap(describe: Overlap[L] => Unit): Unit = {
    val parts = new Overlap[L]
    describe(parts)
    parts.labels.foreach { case (cycle, label) => place(label, bodies.size + cycle) }
    parts.byCycle.foreach(together => step(together.foreach(part => part())))
  }

  /** In a step: writes a register. */
  def set[T <: Data](register: T, value: T, condition: Bool = true.B): Unit =
    when(now && condition)(register := value)

  /** In a step: asserts a control signal, which is low in all other steps. */
  def raise(signal: Bool): Unit = raise(signal, None)

  /** In a step: asserts a control signal if the condition holds. */
  def raise(signal: Bool, condition: Bool): Unit = raise(signal, Some(condition))

  private def raise(signal: Bool, condition: Option[Bool]): Unit = {
    val steps = raised.getOrElseUpdate(signal, mutable.LinkedHashMap.empty)
    steps(condition) = steps.getOrElse(condition, Set.empty[Int]) + index
  }

  /** In a step: asserts a control signal that comes from a register of its own, decoded from the next step. For signals
    * at the start of the slowest paths.
    */
  def raiseEarly(signal: Bool): Unit = early(signal) = early.getOrElse(signal, Set.empty) + index

  /** No step may raise two of these signals. */
  def exclusive(unit: String, signals: Seq[Bool]): Unit = units += unit -> signals

  /** In a step, at most once: takes the first exit whose condition holds. If none does, the next step follows. */
  def branch(exits: Exit[L]*): Unit = {
    require(!branches.contains(index), s"two branches in step $index")
    branches(index) = exits
  }

  /** In a step: jumps. */
  def goto(label: L): Unit = branch(label.otherwise)

  /** In a step: repeats it until the condition holds.
    *
    * @param reason what the step waits for
    */
  def await(condition: Bool, reason: String): Unit = branch(Repeat.until(condition, reason))

  /** The current step has this label. */
  def isAt(label: L): Bool = state match {
    case Some(register) => register.isNow(positionOf(label))
    case None           => places.getOrElseUpdate(label, Wire(Bool()).suggestName(s"is$label"))
  }

  /** Makes the steps. */
  def build(): Unit = {
    val register = StepRegister(encoding, names)
    state = Some(register)
    for ((body, index) <- bodies.zipWithIndex) {
      active = Some((index, register.isNow(index)))
      body()
    }
    active = None
    require(branches.contains(bodies.size - 1), "the last step goes on to a step that is not there")
    units.foreach { case (unit, signals) => checkExclusive(unit, signals) }

    // Exits: a condition counts if none before it holds
    val taken  = mutable.Map.empty[Int, Seq[Bool]]
    val onward = bodies.indices.map { index =>
      branches.getOrElse(index, Nil).foldLeft(register.isNow(index)) { (left, exit) =>
        val target = exit.target.fold(index)(positionOf)
        taken(target) = taken.getOrElse(target, Nil) :+ exit.condition.fold(left)(left && _)
        exit.condition.fold(false.B)(left && !_)
      }
    }
    register.connect(taken.toMap, onward)

    def isNow(steps: Set[Int]): Bool = steps.toSeq.sorted.map(register.isNow).reduce(_ || _)
    for ((signal, groups) <- raised)
      signal := groups.map { case (condition, steps) => condition.foldLeft(isNow(steps))(_ && _) }.reduce(_ || _)
    for ((signal, steps) <- early) signal      := isOneOf(steps)
    for ((label, isActive) <- places) isActive := register.isNow(positionOf(label))
  }

  /** Once the program is built: the encoding's stall repeats the current step. */
  def isStalled: Bool = built.isStalled

  /** Once the program is built: one of these steps is current. A register of its own. */
  private[microcode] def isOneOf(steps: Set[Int]): Bool =
    RegNext(built.isNext(steps.toSeq.sorted), steps.contains(0).B)

  private def built: StepRegister = state.getOrElse(throw new IllegalStateException("before the program is built"))

  /** The state graph in Graphviz's DOT, once the program is built. A node is a label and the steps up to the next one.
    */
  def graph(name: String): String = ProgramGraph.draw(name, bodies.size, labels.toSeq, branches.toMap)

  private def positionOf(label: L): Int = labels.getOrElse(label, throw new NoSuchElementException(s"no step $label"))

  /** Steps by label and distance from it. */
  private def names: Seq[String] = {
    val byPosition = labels.map(_.swap)
    require(byPosition.contains(0), "the first step has no label")
    bodies.indices.map { index =>
      val start = (index to 0 by -1).find(byPosition.contains).get
      s"${byPosition(start)}_${index - start}"
    }
  }

  private def checkExclusive(unit: String, signals: Seq[Bool]): Unit = {
    val steps = signals.flatMap(signal =>
      raised.get(signal).toSeq.flatMap(_.values.flatten.toSet) ++ early.getOrElse(signal, Nil)
    )
    steps.diff(steps.distinct).headOption.foreach { step =>
      throw new IllegalArgumentException(s"two operations of the $unit in step $step")
    }
  }
}

/** A step that a program can jump to. A program's labels are the case objects of one sealed trait, so a jump into
  * another program does not compile.
  */
trait Label {

  /** A jump to this step.
    *
    * @param reason the condition in words, for the program's graph
    */
  def when(condition: Bool, reason: String): Exit[this.type] = Exit(Some(this), Some(condition), reason)

  /** A jump to this step that is always taken. */
  def otherwise: Exit[this.type] = Exit(Some(this), None, "")
}

/** One way out of a step.
  *
  * @param target    the next step; none repeats the step that it leaves
  * @param condition none always holds
  * @param reason    the condition in words; of a repetition, what it waits for
  */
final case class Exit[+L <: Label](target: Option[L], condition: Option[Bool], reason: String)

/** A step that waits. */
object Repeat {

  /** Repeats the step until the condition holds.
    *
    * @param reason what the step waits for
    */
  def until(condition: Bool, reason: String): Exit[Nothing] = Exit(None, Some(!condition), reason)
}

/** Parts of consecutive steps, see [[Microprogram.overlap]]. */
final class Overlap[L <: Label] {
  private val parts  = mutable.ArrayBuffer.empty[(Int, () => Unit)]
  private val placed = mutable.ArrayBuffer.empty[(Int, L)]

  /** Adds a part to the step of this cycle. */
  def apply(cycle: Int)(part: => Unit): Unit = parts += cycle -> (() => part)

  /** Labels the step of this cycle. */
  def label(cycle: Int, label: L): Unit = placed += cycle -> label

  private[microcode] def labels: Seq[(Int, L)] = placed.toSeq

  /** The parts of each cycle up to the last. */
  private[microcode] def byCycle: Seq[Seq[() => Unit]] =
    (0 to parts.map(_._1).max).map(cycle => parts.toSeq.collect { case (`cycle`, part) => part })
}
