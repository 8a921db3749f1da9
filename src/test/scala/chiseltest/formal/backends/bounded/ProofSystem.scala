package chiseltest.formal.backends.bounded

import chisel3.Module
import chiseltest.formal.backends.FlattenPass
import chiseltest.simulator.Compiler
import firrtl2.annotations.Annotation
import firrtl2.backends.experimental.smt._
import firrtl2.backends.experimental.smt.random.{InvalidToRandomPass, UndefinedMemoryBehaviorPass}
import firrtl2.options.{Dependency, TargetDirAnnotation}
import firrtl2.stage.{FirrtlCircuitAnnotation, FirrtlPhase, Forms, RunFirrtlTransformAnnotation}
import firrtl2.transforms.formal.DontAssertSubmoduleAssumptionsAnnotation
import firrtl2.{ir, CircuitState}

import scala.collection.mutable

/** A module as a transition system of registers, what it claims, and where its files go.
  *
  * @param assertions names of signals that are set where an assertion is violated
  * @param covers     names of signals that are set where a `cover` of the module happens
  */
private[bounded] final case class ProofSystem(
    system:     TransitionSystem,
    directory:  os.Path,
    assertions: Seq[String],
    covers:     Seq[String],
    texts:      Map[String, String]
) {

  /** The text and the place of an assertion, the place of a cover. */
  def describe(name: String): String = {
    val place = system.comments.getOrElse(name, name).replaceAll("^@ *\\[|\\]$", "")
    texts.get(place).fold(place)(text => s"'$text' ($place)")
  }
}

private[bounded] object ProofSystem {
  def apply(module: () => Module, directory: String): ProofSystem = {
    val (elaborated, _) = Compiler.elaborate(module, Seq(TargetDirAnnotation(directory)), Seq())
    val low             = Compiler.toLowFirrtl(elaborated, Seq(DontAssertSubmoduleAssumptionsAnnotation))
    val covers          = mutable.LinkedHashSet.empty[String]
    val texts           = mutable.HashMap.empty[String, String]
    val asserting       = low.circuit.mapModule { module =>
      MemoryPorts.split(module).mapStmt(withoutCovers(_, covers, texts))
    }
    val system = Memories.toRegisters(flatten(CircuitState(asserting, low.annotations)))
    val bad    = system.signals.filter(_.lbl == IsBad).map(_.name)
    ProofSystem(
      system,
      Compiler.requireTargetDir(low.annotations),
      bad.filterNot(covers),
      bad.filter(covers),
      texts.toMap
    )
  }

  /** The flat system does not know covers: asserts the contrary, and notes its name. Also notes the texts of assertions
    * by place, which are in a print of their own.
    */
  private def withoutCovers(
      statement: ir.Statement,
      covers:    mutable.Set[String],
      texts:     mutable.Map[String, String]
  ): ir.Statement = statement match {
    case cover: ir.Verification if cover.op == ir.Formal.Cover =>
      covers += cover.name
      val never = ir.DoPrim(firrtl2.PrimOps.Not, Seq(cover.pred), Seq(), ir.UIntType(ir.IntWidth(1)))
      cover.copy(op = ir.Formal.Assert, pred = never)
    case print: ir.Print =>
      texts += place(print.info) -> print.string.string.linesIterator.next().stripPrefix("Assertion failed: ")
      ir.EmptyStmt
    case other => other.mapStmt(withoutCovers(_, covers, texts))
  }

  private def place(info: ir.Info): String = info match {
    case file: ir.FileInfo => file.unescaped
    case _                 => ""
  }

  private def flatten(state: CircuitState): TransitionSystem = {
    val transforms = Seq(
      RunFirrtlTransformAnnotation(Dependency(InvalidToRandomPass)),
      RunFirrtlTransformAnnotation(Dependency(UndefinedMemoryBehaviorPass)),
      RunFirrtlTransformAnnotation(Dependency(FlattenPass)),
      RunFirrtlTransformAnnotation(Dependency[firrtl2.passes.InlineInstances]),
      RunFirrtlTransformAnnotation(Dependency[firrtl2.transforms.ConstantPropagation]),
      RunFirrtlTransformAnnotation(Dependency(firrtl2.passes.CommonSubexpressionElimination)),
      RunFirrtlTransformAnnotation(Dependency[firrtl2.transforms.DeadCodeElimination]),
      RunFirrtlTransformAnnotation(Dependency(SMTLibEmitter))
    )
    val input: Seq[Annotation] = Seq(
      new firrtl2.stage.CurrentFirrtlStateAnnotation(Forms.LowForm),
      FirrtlCircuitAnnotation(state.circuit)
    )
    val results = new FirrtlPhase().transform(input ++ state.annotations ++ transforms)
    results.collectFirst { case TransitionSystemAnnotation(system) => system }.get
  }
}
