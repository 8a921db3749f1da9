package colonnade

import firrtl2._
import firrtl2.ir._
import org.scalatest.{Args, Reporter, Suite}
import org.scalatest.events.Event

import java.io.PrintStream
import java.nio.charset.StandardCharsets.UTF_8
import java.nio.file.{Files, Paths}
import java.nio.file.StandardOpenOption.{APPEND, CREATE}
import java.security.MessageDigest
import scala.collection.mutable
import scala.jdk.CollectionConverters._
import scala.util.Try

/** Random faults in the circuits of [[KeptSimulators]], all in one simulator: an input of each module chooses one by
  * its number, and 0 none. A fault is another operation, the other way of a multiplexer, or an inverted bit, at a place
  * in the sources of the hardware; so it is the same in every shape of a module, and in every test that simulates the
  * module.
  */
object Mutants {

  /** The faults to build in: at most so many of a file, those with the least digests of the seed. */
  final case class Choice(seed: Int, perFile: Int)

  /** A fault, with its number: `file line:column operation index`. */
  final case class Mutant(name: String, number: BigInt)

  /** None: simulators are built without faults. */
  var choice: Option[Choice] = None

  /** The fault of the simulations to come; 0 is none. */
  var active: BigInt = 0

  /** Those in the simulations of the last test. */
  val present: mutable.Set[Mutant] = mutable.Set.empty

  /** Cycles of the last test, and how many it may take. */
  var cycles = 0L
  var limit  = Long.MaxValue

  val port          = "mutant"
  private val width = 31
  private val kind  = UIntType(IntWidth(width))
  private val one   = UIntType(IntWidth(1))
  private val at    = "src/main/scala/colonnade/"

  private val others: Map[PrimOp, PrimOp] = {
    import PrimOps._
    val pairs = Seq(And -> Or, Add -> Sub, Eq -> Neq, Lt -> Geq, Leq -> Gt)
    (pairs ++ pairs.map(_.swap)).toMap
  }

  /** The circuit with the faults of the choice, and these. */
  def insert(circuit: Circuit, choice: Choice): (Circuit, Seq[Mutant]) = {
    val found = circuit.modules.collect { case module: Module =>
      new Finder(module, choice.seed).found
    }.flatten.distinct
    val byFile   = found.groupBy(_.name.takeWhile(_ != ' ')).toSeq.sortBy(_._1)
    val selected = byFile.flatMap(_._2.sortBy(_.number).take(choice.perFile))
    val names    = selected.toSet
    val result   = circuit.copy(modules = circuit.modules.map {
      case module: Module => new Finder(module, choice.seed, names).changed(circuit)
      case other          => other
    })
    (result, selected)
  }

  /** Finds the faults of a module, and puts in those of `selected`. */
  private class Finder(module: Module, seed: Int, selected: Set[Mutant] = Set.empty) {
    private val all    = mutable.Buffer.empty[Mutant]
    private val counts = mutable.Map.empty[String, Int].withDefaultValue(0)
    private val input  = Reference(port, kind, PortKind, SourceFlow)

    lazy val found: Seq[Mutant] = { statement(module.body); all.toSeq }

    def changed(circuit: Circuit): Module = {
      val inner                                 = circuit.modules.collect { case inner: Module => inner.name }.toSet
      def withPorts(body: Statement): Statement = body match {
        case instance @ DefInstance(_, name, of, tpe: BundleType) if inner(of) =>
          val wide = tpe.copy(fields = tpe.fields :+ Field(port, Flip, kind))
          val to   = SubField(Reference(name, wide, InstanceKind, SourceFlow), port, kind, SinkFlow)
          Block(Seq(instance.copy(tpe = wide), Connect(NoInfo, to, input)))
        case other => other.mapStmt(withPorts)
      }
      module.copy(
        ports = module.ports :+ Port(NoInfo, port, Input, kind),
        body = withPorts(statement(module.body))
      )
    }

    private def statement(body: Statement): Statement = body match {
      case node: DefNode => node.copy(value = expression(node.info, node.value))
      case to: Connect   => to.copy(expr = expression(to.info, to.expr))
      case other         => other.mapStmt(statement)
    }

    private def expression(info: Info, value: Expression): Expression =
      if (!info.serialize.contains(at)) value
      else {
        val where = info.serialize.split(at).last.takeWhile(letter => letter != ',' && letter != ']').trim
        changes(value).foldLeft(value) { case (good, (name, bad)) =>
          val label = s"$where $name"
          val count = counts(label)
          counts(label) += 1
          val mutant = of(s"$label $count", seed)
          all += mutant
          val isActive = DoPrim(PrimOps.Eq, Seq(input, UIntLiteral(mutant.number, IntWidth(width))), Nil, one)
          if (selected(mutant)) Mux(isActive, bad, good, value.tpe) else good
        }
      }

    /** Other values of the same type, by name. */
    private def changes(value: Expression): Seq[(String, Expression)] = value match {
      case prim @ DoPrim(op, _, _, _) if others.contains(op) =>
        Seq(s"$op→${others(op)}" -> prim.copy(op = others(op)))
      case prim @ DoPrim(PrimOps.Not, args, _, tpe) if args.head.tpe == tpe => Seq("not" -> args.head)
      case mux @ Mux(_, yes, no, _) => Seq("mux" -> mux.copy(tval = no, fval = yes))
      case other                    => other.tpe match {
          case UIntType(IntWidth(bits)) if bits > 0 => Seq("bit" -> flipped(other, bits.toInt))
          case _                                    => Nil
        }
    }

    private def flipped(value: Expression, bits: Int): Expression = {
      val bit = BigInt(1) << (digest(s"$seed ${bits}") % bits).toInt
      DoPrim(PrimOps.Xor, Seq(value, UIntLiteral(bit, IntWidth(bits))), Nil, value.tpe)
    }
  }

  private def of(name: String, seed: Int): Mutant = Mutant(name, digest(s"$seed $name") % (BigInt(1) << width).-(1) + 1)

  private def digest(text: String): BigInt =
    BigInt(1, MessageDigest.getInstance("SHA-256").digest(text.getBytes(UTF_8)).take(8))
}

/** Runs tests of suites against random faults ([[Mutants]]), for `tools/mutations --random`. Writes a line of JSON for
  * each test, with its CPU seconds; for each fault that it was given, with whether it found it; and for each suite's
  * end.
  *
  * Arguments: the file of the lines, which is continued; the seed; faults of a file of the sources; suites.
  */
object RandomMutants {

  /** A fault that so many tests have found is not given to more expensive ones. */
  private val enough = 2

  private object Silent extends Reporter { def apply(event: Event): Unit = () }

  private final case class Test(
      name:     String,
      isMatrix: Boolean,
      seconds:  Double,
      cycles:   Long,
      mutants:  Set[Mutants.Mutant]
  )

  def main(arguments: Array[String]): Unit = {
    val path   = Paths.get(arguments.head)
    val before = if (Files.exists(path)) Files.readAllLines(path).asScala.map(ujson.read(_).obj).toSeq else Nil
    val kills  = mutable.Map.from(before.filter(_.get("killed").contains(ujson.True)).groupMapReduce(_("mutant").str)(
      _ => 1
    )(_ + _))
    val finished = before.filter(_.contains("end")).map(_("end").str)
    val lines    = new PrintStream(Files.newOutputStream(path, CREATE, APPEND), true, "UTF-8")
    def write(values: (String, ujson.Value)*): Unit = lines.println(ujson.write(ujson.Obj.from(values)))

    Mutants.choice = Some(Mutants.Choice(seed = arguments(1).toInt, perFile = arguments(2).toInt))
    for (name <- arguments.drop(3) if !finished.contains(name)) {
      val suite = Class.forName(s"colonnade.$name").getDeclaredConstructor().newInstance().asInstanceOf[Suite]
      val (failing, good) = suite.testNames.toSeq.partitionMap(clean(suite, _))
      failing.foreach(test => write("suite" -> name, "failing" -> test))
      val tests = good.flatten.sortBy(test => (test.isMatrix, test.seconds))
      for (test <- tests)
        write("suite" -> name, "test" -> test.name, "matrix" -> test.isMatrix, "seconds" -> test.seconds)
      for (mutant <- tests.flatMap(_.mutants).distinct.sortBy(_.number); test <- tests if test.mutants(mutant)) {
        val found = kills.getOrElse(mutant.name, 0)
        if (found < (if (test.isMatrix) 1 else enough)) {
          val isKilled = !passes(suite, test.name, mutant.number, 10 * test.cycles + 10000)
          if (isKilled) kills(mutant.name) = found + 1
          write("suite" -> name, "test" -> test.name, "mutant" -> mutant.name, "killed" -> isKilled)
        }
      }
      write("end" -> name)
    }
  }

  /** A test without a fault, if it simulates a circuit that has some; its name if it fails. Its seconds include the
    * build of its simulator, which tests of a suite may share: the first one builds it.
    */
  private def clean(suite: Suite, name: String): Either[String, Option[Test]] = {
    Mutants.present.clear()
    val start = SuiteSeconds.used()
    if (!passes(suite, name, 0, Long.MaxValue)) Left(name)
    else
      Right(Option.when(Mutants.present.nonEmpty) {
        val isMatrix = suite.tags.get(name).exists(_.contains(Matrix.name))
        Test(name, isMatrix, SuiteSeconds.used() - start, Mutants.cycles, Mutants.present.toSet)
      })
  }

  private def passes(suite: Suite, test: String, mutant: BigInt, limit: Long): Boolean = {
    Mutants.active = mutant
    Mutants.cycles = 0
    Mutants.limit = limit
    Try(suite.run(Some(test), Args(Silent)).succeeds()).getOrElse(false)
  }
}
