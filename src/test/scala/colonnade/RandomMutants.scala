package colonnade

import org.scalatest.events.Event
import org.scalatest.{Args, Reporter, Suite}

import java.io.PrintStream
import java.nio.file.StandardOpenOption.{APPEND, CREATE}
import java.nio.file.{Files, Paths}
import scala.collection.mutable
import scala.jdk.CollectionConverters._
import scala.util.Try

/** Runs tests of suites against random faults ([[Mutants]]), for `tools/mutations --random`. Writes a line of JSON for each
  * test, with its CPU seconds; for each fault that it was given, with whether it found it; and for each suite's end.
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
      val tests = suite.testNames.toSeq.flatMap(clean(suite, _)).sortBy(test => (test.isMatrix, test.seconds))
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

  /** A test without a fault, if it simulates a circuit that has some; run twice, as the first time builds the simulator. */
  private def clean(suite: Suite, name: String): Option[Test] = {
    Mutants.present.clear()
    require(passes(suite, name, 0, Long.MaxValue), s"$name fails without a fault")
    Option.when(Mutants.present.nonEmpty) {
      val start = SuiteSeconds.used()
      passes(suite, name, 0, Long.MaxValue)
      val isMatrix = suite.tags.get(name).exists(_.contains(Matrix.name))
      Test(name, isMatrix, SuiteSeconds.used() - start, Mutants.cycles, Mutants.present.toSet)
    }
  }

  private def passes(suite: Suite, test: String, mutant: BigInt, limit: Long): Boolean = {
    Mutants.active = mutant
    Mutants.cycles = 0
    Mutants.limit = limit
    Try(suite.run(Some(test), Args(Silent)).succeeds()).getOrElse(false)
  }
}
